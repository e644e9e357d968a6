"""Whether a mutant differs from its design at any pin, ever: a proof, or a way to see it.

Both stand side by side with the same inputs. Yosys turns all clocks and asynchronous resets into
steps of one time (its ``clk2fflogic``), so clocks may come in any order and inputs do what they
like. The first step is in standby; registers that no reset reaches start with the same unknown
value in both, every other one with any value of its own. The level of a pin that is not driven is
no difference.

A proof is by induction over one step, and what makes it inductive is found, not given: of many
guesses (each bit that the two have in common is equal; no two values of narrow registers of a
block come together) those are kept that hold in standby, and hold in the next step whenever all
kept ones hold. Where the pins' equality is not among them a counterexample is looked for.
"""

import json
import re
import time
from collections.abc import Mapping, Sequence
from itertools import combinations, product
from typing import NamedTuple

from amaranth.lib.wiring import Component, In

from cubestack.firmware_model.interface.pins import Pin
from cubestack.hdl.blocks.pinned import PinnedComponent
from cubestack.hdl.flow.tools import yosys_files
from tests.hdl.mutants.netlist import Mutant, Netlist

_EXPOSE = """
hierarchy -top dut
setattr -mod -unset keep_hierarchy *
flatten
expose dut/w:* dut/w:$* %d
"""

_GOLD = f"""
read_rtlil netlist.il
{_EXPOSE}
write_json flat.json
rename dut gold
write_rtlil gold.il
"""

_JOIN = f"""
read_rtlil netlist.il
{{mutation}}
{_EXPOSE}
rename dut gate
read_rtlil gold.il
read_verilog harness.v
hierarchy -top harness
proc
flatten
clk2fflogic
opt -full
"""

_START = "-set-at 1 standby 1 -set-at 1 retained 1"

_NARROW_BITS = 4  #: Registers wider than this are not guessed about

_GROUPS = 12  #: Counterexamples looked for at once

#: Steps of a counterexample, at most and before more is guessed; a clock takes two.
STEPS, SOON = 40, 16

#: Registers that a level resets; Yosys takes other resets for a part of the next state.
_RESET = ("$adff", "$adffe")
_MODEL = re.compile(r"^ +(\d+) \\(guess\d+) .* ([01]+) *$", re.MULTILINE)


Texts = Sequence[str]


class Verdict(NamedTuple):
    """What is known of a mutant: ``equivalent``, or else the steps to a difference if one is known.

    With neither, nothing is known.
    """

    equivalent: bool
    steps: int | None
    seconds: float


class Equivalence:
    def __init__(self, netlist: Netlist, design: Component, standby: Mapping[str, int]) -> None:
        """Take a design as a ``netlist`` too, and the levels of its inputs in ``standby``.

        ToolMissingError without a Yosys.
        """
        self._netlist = netlist
        files = {"netlist.il": netlist.text}
        _, self._gold, flat = yosys_files(_GOLD, files, "gold.il", "flat.json")
        module = json.loads(flat)["modules"]["dut"]
        ports = module["ports"].items()
        self._inputs = {n: len(p["bits"]) for n, p in ports if p["direction"] == "input"}
        outputs = {n: p["bits"] for n, p in ports if p["direction"] == "output"}
        self._wires = {name: len(bits) for name, bits in outputs.items()}
        self._index = {name: number for number, name in enumerate(self._wires)}
        self._standby = " & ".join(f"\\{n} == {level}" for n, level in standby.items())
        self._pins = " & ".join(self._pin_is_same(pin) for pin in _pins(design) if pin.level_out)
        registers: dict[int, bool] = {
            bit: cell["type"] not in _RESET
            for cell in module["cells"].values()
            if "dff" in cell["type"]
            for bit in cell["connections"]["Q"]
        }
        places = [(bit, name, n) for name, bits in outputs.items() for n, bit in enumerate(bits)]
        retained = [self._same(name, n) for bit, name, n in places if registers.get(bit)]
        self._retained = " & ".join(retained) or "1"
        narrow = {name: bits for name, bits in outputs.items() if len(bits) <= _NARROW_BITS}
        self._narrow = [name for name, bits in narrow.items() if registers.keys() >= {*bits}]
        self._invariants: dict[str, list[str]] = {}  # by the block that they are of

    def compare(self, mutant: Mutant) -> Verdict:
        """Prove that the design with this change is no other one, or look for the difference."""
        start = time.monotonic()
        common = [self._same(name, n) for name, width in self._wires.items() for n in range(width)]
        equal = self._pins in self._kept(mutant, [self._pins, *common], [])
        steps = None if equal else self._counterexample(mutant, SOON)
        if not equal and steps is None:
            block = _block_of(mutant)
            if block not in self._invariants:
                self._invariants[block] = self._kept(None, self._guesses(block), [])
            equal = self._pins in self._kept(mutant, [self._pins, *common], self._invariants[block])
            steps = None if equal else self._counterexample(mutant, STEPS)
        return Verdict(equal, steps, time.monotonic() - start)

    def _same(self, wire: str, bit: int) -> str:
        number = self._index[wire]
        return f"(gold{number}[{bit}] == gate{number}[{bit}])"

    def _pin_is_same(self, pin: Pin) -> str:
        level = self._index[str(pin.level_out)]
        if pin.enable is None:
            return f"(gold{level} == gate{level})"
        enable = self._index[pin.enable]
        mask = f"{{{pin.width}{{gold{enable}}}}}" if pin.enables == 1 else f"gold{enable}"
        equal = f"(((gold{level} ^ gate{level}) & {mask}) == 0)"
        return f"((gold{enable} == gate{enable}) & {equal})"

    def _guesses(self, block: str) -> list[str]:
        """That narrow registers below ``block`` never have some value, or two values together."""
        below = {n: self._index[n] for n in self._narrow if n.startswith(block)}
        levels = {
            name: [f"(gold{number} == {value})" for value in range(1 << self._wires[name])]
            for name, number in below.items()
        }
        several = [values for values in levels.values() if len(values) > 2]
        single = [f"~{level}" for values in several for level in values]
        pairs = [
            f"~({a} & {b})"
            for one, other in combinations(sorted(levels), 2)
            if _block(one) == _block(other)
            for a, b in product(levels[one], levels[other])
        ]
        return single + pairs

    def _kept(self, mutant: Mutant | None, guesses: list[str], known: Sequence[str]) -> list[str]:
        """The largest inductive set of ``guesses``, while ``known`` holds at any time."""
        for steps, options in ((1, f"-seq 1 {_START}"), (2, "-seq 2 -set-at 1 all 1")):
            while guesses and (wrong := self._refuted(mutant, guesses, known, steps, options)):
                guesses = [guess for n, guess in enumerate(guesses) if n not in wrong]
        return guesses

    def _refuted(
        self, mutant: Mutant | None, guesses: Texts, known: Texts, steps: int, options: str
    ) -> set[int]:
        """Indices of guesses that can be wrong in the last step: some, if there are any."""
        size = -(-len(guesses) // _GROUPS)
        groups = [guesses[at : at + size] for at in range(0, len(guesses), size)]
        show = " ".join(f"-show guess{n}" for n in range(len(groups)))
        call = f"sat {options} -set known 1 -set-at {steps}"
        calls = [f"{call} all{n} 0 {show}" for n in range(len(groups))]
        report = self._run(mutant, groups, known, calls)
        wrong = set()
        for step, name, bits in _MODEL.findall(report):
            if int(step) == steps:
                offset = int(name.removeprefix("guess")) * size
                wrong |= {offset + n for n, bit in enumerate(bits[::-1]) if bit == "0"}
        return wrong

    def _counterexample(self, mutant: Mutant, most: int) -> int | None:
        """Steps from standby to a difference at the pins; None when there is none in ``most``."""
        call = f"sat -tempinduct-baseonly -maxsteps {most} {_START} -prove all 1 -show all"
        report = self._run(mutant, [[self._pins]], [], [call])
        if "model found for base case: FAIL!" not in report:
            return None
        return len(re.findall(r"^\[base case \d+\]", report, re.MULTILINE))

    def _run(
        self, mutant: Mutant | None, groups: Sequence[Texts], known: Texts, calls: Texts
    ) -> str:
        script = _JOIN.format(mutation=mutant.command() if mutant else "")
        files = {"netlist.il": self._netlist.text, "gold.il": self._gold}
        files["harness.v"] = self._harness(groups, known)
        return yosys_files(script + "\n".join(calls), files)[0]

    def _harness(self, groups: Sequence[Texts], known: Texts) -> str:
        """Verilog of both side by side; group n of guesses is ``guess<n>``, and ``all<n>``."""
        outputs = [("standby", self._standby), ("retained", self._retained)]
        vectors = {f"guess{n}": group for n, group in enumerate(groups)}
        vectors["known_one"] = known or ["1'b1"]
        outputs.append(("known", "&known_one"))
        outputs += [(f"all{n}", f"&guess{n}") for n in range(len(groups))]
        outputs.append(("all", " & ".join(f"all{n}" for n in range(len(groups)))))
        ports = [f"  input [{width - 1}:0] \\{name} " for name, width in self._inputs.items()]
        ports += [f"  output {name}" for name, _ in outputs]
        ports += [f"  output [{len(v) - 1}:0] {name}" for name, v in vectors.items()]
        lines = ["module harness (", ",\n".join(ports), ");"]
        for side in ("gold", "gate"):
            wires = [(name, f"{side}{number}") for name, number in self._index.items()]
            lines += [f"  wire [{self._wires[name] - 1}:0] {wire};" for name, wire in wires]
            pins = [f"    .\\{name} (\\{name} )" for name in self._inputs]
            pins += [f"    .\\{name} ({wire})" for name, wire in wires]
            lines += [f"  {side} {side} (", ",\n".join(pins), "  );"]
        lines += [f"  assign {name} = {value};" for name, value in outputs]
        for name, values in vectors.items():
            lines += [f"  assign {name}[{n}] = {value};" for n, value in enumerate(values)]
        return "\n".join([*lines, "endmodule\n"])


def _pins(design: Component) -> tuple[Pin, ...]:
    """Its table of pins; of a block, which has none, each port as a pin of its own."""
    if isinstance(design, PinnedComponent):
        return design.pins
    return tuple(
        Pin(name, "input" if member.flow is In else "output", "", len(getattr(design, name)))
        for name, member in design.signature.members.items()
    )


def _block(name: str) -> str:
    """Where a signal belongs, a counter being a part of what it counts for."""
    return name.rpartition(".")[0].removesuffix("counter").removesuffix(".")


def _block_of(mutant: Mutant) -> str:
    """Where its cell comes from, with a dot at its end; empty when that is not known."""
    inside = mutant.module.removeprefix("dut").removeprefix(".")
    parts = re.findall(r"\\([^\\]+)\.(?=[\\$])", mutant.cell)
    path = [part for part in [inside, *parts] if part]
    if path and path[-1].partition("$")[0] == "counter":
        path.pop()
    return "".join(f"{part}." for part in path)

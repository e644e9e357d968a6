"""A design as a netlist of word-wide cells, and mutants of it.

Yosys' ``mutate`` changes one bit at one port of one cell: inverted, stuck at 0 or 1, or inverted
under another bit of the same port. The netlist is simplified first, so few mutants differ in
nothing. All of them can be in one Verilog text, which then needs to be compiled once: the plus-
argument ``+mutant=N`` chooses one, and no plus-argument, or 0, the design itself.
"""

import hashlib
import random
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from amaranth.back import rtlil
from amaranth.lib.wiring import Component

from cubestack.hdl.flow.tools import yosys_files

_SIMPLIFY = """
read_rtlil design.il
hierarchy -top dut
{keep}
proc -norom
flatten
opt -full
opt_clean -purge
attrmap -remove init
write_rtlil netlist.il
"""

_LIST = """
read_rtlil netlist.il
mutate -list {count} -seed {seed} -o mutants.txt
"""

_SELECTABLE = """
read_rtlil netlist.il
{mutations}
delete -port dut/w:{control}
write_verilog -noattr -norename mutants.v
"""

#: The wire that chooses a mutant; Yosys leads it to every module that has one.
_CONTROL = "chosen_mutant"
_CONTROL_BITS = 16

_ALL = 10**6  #: More than any design here has

_SOURCE = re.compile(r'^(\s*attribute \\src ")([^"]*)"$', re.MULTILINE)
_OPTION = re.compile(r" -(\S+) (\S+)")


@dataclass(frozen=True)
class Netlist:
    """A design as RTLIL; its top module is ``dut``.

    Registers have no initial value: the part's have none.
    """

    text: str

    @property
    def digest(self) -> str:
        """Of the text without places in the source, in hexadecimal digits."""
        return hashlib.sha256(_SOURCE.sub("", self.text).encode()).hexdigest()


class Mutant(NamedTuple):
    """One change."""

    mode: str  # "inv", "const0" or "const1"; "cnot0" or "cnot1" inverts while a bit is 0 or 1
    module: str
    cell: str
    port: str
    bit: int
    control_bit: int | None = None  # that bit, of the same port
    wire: str = ""  # the bit's name in the design, if it has one
    source: tuple[str, ...] = ()  # lines of the design's source that the cell comes from

    def command(self) -> str:
        text = (
            f"mutate -mode {self.mode} -module {self.module} -cell {self.cell} "
            f"-port {self.port} -portbit {self.bit}"
        )
        return text if self.control_bit is None else f"{text} -ctrlbit {self.control_bit}"

    def __str__(self) -> str:
        where = f"{self.module}/" if self.module != "dut" else ""
        name = f" ({self.wire})" if self.wire else ""
        under = "" if self.control_bit is None else f" under bit {self.control_bit}"
        lines = ", ".join(self.source)
        return f"{self.mode}{under} at {where}{self.cell}.{self.port}[{self.bit}]{name}: {lines}"


def netlist(component: Component, kept: Sequence[str] = ()) -> Netlist:
    """Simplify a design; submodules of the top named in ``kept`` stay modules of their own.

    ToolMissingError without a Yosys.
    """
    text = str(rtlil.convert(component, name="dut", emit_src=True))
    text = _SOURCE.sub(lambda found: f'{found[1]}{_basenames(found[2])}"', text)
    keep = "".join(f"setattr -mod -set keep_hierarchy 1 dut.{name}\n" for name in kept)
    _, simplified = yosys_files(_SIMPLIFY.format(keep=keep), {"design.il": text}, "netlist.il")
    return Netlist(re.sub(r"^# Generated.*\n", "", simplified))


def mutants(
    design: Netlist, count: int | None = None, seed: int = 1, source: str = ""
) -> list[Mutant]:
    """``count`` mutants spread over the design's source, wires and cells; all of them with None.

    The same seed gives the same ones. With ``source``, the name of a file of the design, only
    mutants of what comes from there, and not more than there are.
    """
    if source:
        every = [m for m in mutants(design) if any(s.startswith(f"{source}:") for s in m.source)]
        chosen = len(every) if count is None else min(count, len(every))
        return random.Random(seed).sample(every, chosen)
    script = _LIST.format(count=_ALL if count is None else count, seed=seed)
    _, listed = yosys_files(script, {"netlist.il": design.text}, "mutants.txt")
    return [_parsed(line) for line in listed.splitlines()]


def selectable(design: Netlist, chosen: Sequence[Mutant]) -> str:
    """Verilog of the design and ``chosen`` mutants of it, which count from 1 on."""
    if len(chosen) >= 1 << _CONTROL_BITS:
        raise ValueError(f"at most {(1 << _CONTROL_BITS) - 1} mutants, not {len(chosen)}")
    mutations = "\n".join(
        f"{mutant.command()} -ctrl {_CONTROL} {_CONTROL_BITS} {number}"
        for number, mutant in enumerate(chosen, 1)
    )
    script = _SELECTABLE.format(mutations=mutations, control=_CONTROL)
    _, text = yosys_files(script, {"netlist.il": design.text}, "mutants.v")
    bus = f"[{_CONTROL_BITS - 1}:0] {_CONTROL};\n"
    argument = f'initial if (!$value$plusargs("mutant=%d", {_CONTROL})) {_CONTROL} = 0;\n'
    # In the top it is no port any more.
    own = re.compile(f"(?<!input {re.escape(bus)})^  wire {re.escape(bus)}", re.MULTILINE)
    return own.sub(lambda _: f"  reg {bus}  {argument}", text)


def _parsed(line: str) -> Mutant:
    options = _OPTION.findall(line)
    one = dict(options)
    return Mutant(
        *(one[name] for name in ("mode", "module", "cell", "port")),
        int(one["portbit"]),
        int(one["ctrlbit"]) if "ctrlbit" in one else None,
        f"{one['wire']}[{one['wirebit']}]" if "wire" in one else "",
        tuple(value for name, value in options if name == "src"),
    )


def _basenames(sources: str) -> str:
    """The same places on every machine: files without their folders."""
    return "|".join(source.rpartition("/")[2] for source in sources.split("|"))

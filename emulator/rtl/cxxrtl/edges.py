"""Edges of clocks that come out of registers, in CXXRTL's C++.

CXXRTL detects such an edge before the register's new level is committed. What the register clocks
would then sample the old levels of registers that change at the same time; in Verilog and VHDL it
samples the new ones. Here the edge is detected in the evaluation after the commit.
"""

import re

_DETECTOR = re.compile(
    r"(?P<head>\tbool (?:pos|neg)edge_\w+\(\) const \{\n\t\treturn )"
    r"(?P<old>!?)(?P<name>\w+)\.curr(?P<bit>\.slice<\d+>\(\)\.val\(\)) && "
    r"(?P<new>!?)(?P=name)\.next(?P=bit);"
)
_COMMIT = "\t\tbool changed = false;\n"


def edges_after_commit(design: str) -> str:
    """CXXRTL's C++ with the edges of registers detected after their commit."""
    names = sorted({match["name"] for match in _DETECTOR.finditer(design)})
    for name in names:
        member = re.compile(rf"^\t(?:/\*\w+\*/ )?wire(<\d+>) {name};\n", re.MULTILINE)
        design = member.sub(rf"\g<0>\tvalue\g<1> prev_{name};\n", design)
        kept = f"{_COMMIT}\t\tprev_{name} = {name}.curr;\n"
        design = design.replace(_COMMIT, kept, 1)
    changed = r"\g<head>\g<old>prev_\g<name>\g<bit> && \g<new>\g<name>.curr\g<bit>;"
    return _DETECTOR.sub(changed, design)

"""Splits a variant's evaluation by pixel clock, as C++ for driver.cpp.

CXXRTL's eval() computes everything, and is called until no register changes. A variant needs less
while none of its registers is in reset: an edge of one camera's clock changes that camera's
registers once, and the outputs that depend on them or on the camera's pins. The generated code
computes only these.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field

from cubestack.emulator.rtl.wiring import MEMORY_PINS, CameraPins, Wiring

_NAME = re.compile(r"\b[pi]_\w+")
_LOCAL = re.compile(r"\t(value<\d+>) (\w+);")
_ASSIGNMENT = re.compile(r"\t(\w+) = (.*);")
_AT_EDGE = re.compile(r"\tif \(posedge_(p_\w+)\) \{")
_IN_RESET = re.compile(r"\tif \(((p_\w+)\.curr == value<1> \{[01]u\})\) \{")
_NEXT = re.compile(r"\b(p_\w+)\.next = ")
_IGNORED = re.compile(r"\t(//.*|bool (converged|posedge_\w+) = .*|return converged;)")


def port(name: str) -> str:
    """Member of CXXRTL's class for the pin ``name``."""
    return "p_" + name.replace("_", "__")


@dataclass
class _Evaluation:
    """The statements of eval()."""

    types: dict[str, str] = field(default_factory=dict)  # type of each assigned name
    # names and expressions, in their order
    assignments: list[tuple[str, str]] = field(default_factory=list)
    # by clock, the blocks that set ``.next`` at its rising edge
    at_edge: dict[str, list[str]] = field(default_factory=dict)
    # by condition on a register, the registers that it resets
    resets: dict[str, set[str]] = field(default_factory=dict)


@dataclass(frozen=True)
class _Steps:
    """Generated code of one camera."""

    in_reset: str
    rise: str
    fall: str
    moves: list[bool]
    registers: list[str]


def clock_steps(wiring: Wiring, variant: str, members: dict[str, str], number: int) -> str:
    """Text of struct ``variant_<number>_steps``: the variant's class with additional members.

    - in_reset(camera): whether any register of the camera's clock is or may be in reset, which
      requires eval() and commit().
    - rise<Compare>(camera): the clock has risen; returns whether any register changed, or with
      Compare false nothing of meaning. It changes only the current level of registers.
    - keep(): makes that the next level too, which eval() and copies of the state require.
    - fall(camera): it has fallen, and the camera's other pins may have changed.
    - may_move(camera, memory): whether the clock can change a pin of that memory.

    If eval() has a statement that this module can not parse, in_reset() is always true.
    """
    evaluation = _evaluation(variant, members)
    lines = [f"struct variant_{number}_steps : cxxrtl_variant_{number}::p_top {{"]
    kept: set[str] = set()
    for index, camera in enumerate(wiring.cameras):
        tag = f"std::integral_constant<int, {index}>"
        steps = None if evaluation is None else _steps(wiring, camera, tag, evaluation, members)
        if steps is None:
            steps = _Steps("true", "return true;\n", "", [True] * len(wiring.memories), [])
        kept.update(steps.registers)
        mask = f"{sum(1 << n for n, moves in enumerate(steps.moves) if moves)}u"
        lines += [
            f"bool in_reset({tag}) const {{ return {steps.in_reset}; }}",
            f"template <bool Compare> bool rise({tag}) {{\n{steps.rise}}}",
            f"void fall({tag}) {{\n{steps.fall}}}",
            f"static constexpr bool may_move({tag}, int memory) {{ return {mask} >> memory & 1; }}",
        ]
    lines.append(
        f"void keep() {{ {' '.join(f'{name}.next = {name}.curr;' for name in sorted(kept))} }}"
    )
    return "\n".join(lines) + "\n};\n"


def _evaluation(variant: str, members: dict[str, str]) -> _Evaluation | None:
    """Parse eval(); None for an unknown statement."""
    found = _Evaluation()
    body = variant[variant.index("bool p_top::eval(") :]
    body = body[body.index("\n") + 1 : body.index("\n}\n")]
    lines = iter(body.splitlines())
    for line in lines:
        if _IGNORED.fullmatch(line):
            continue
        if match := _LOCAL.fullmatch(line):
            found.types[match[2]] = match[1]
        elif match := _ASSIGNMENT.fullmatch(line):
            found.types.setdefault(match[1], members.get(match[1], ""))
            found.assignments.append((match[1], match[2]))
        elif match := _AT_EDGE.fullmatch(line):
            found.at_edge.setdefault(match[1], []).append("\n".join([line, *_block(lines)]))
        elif match := _IN_RESET.fullmatch(line):
            block = "\n".join(_block(lines))
            found.resets.setdefault(match[1], set()).update(_NEXT.findall(block))
        else:
            return None
    if body.count(".next") != len(_NEXT.findall(body)):
        return None  # a part of a register
    done: set[str] = set()
    for name, expression in found.assignments:
        later = {*_NAME.findall(expression)} & {*found.types} - done
        if later or name in done:
            return None  # a loop, or a name that is assigned twice
        done.add(name)
    return found


def _block(lines: Iterable[str]) -> list[str]:
    block = []
    for line in lines:
        block.append(line)
        if line == "\t}":
            break
    return block


def _steps(
    wiring: Wiring, camera: CameraPins, tag: str, evaluation: _Evaluation, members: dict[str, str]
) -> _Steps | None:
    """None if an edge of the camera's clock affects more than that camera."""
    clock = port(camera.clock)
    blocks = evaluation.at_edge.get(clock, [])
    registers = sorted({name for block in blocks for name in _NEXT.findall(block)})
    pins = {port(name) for name in camera.pins}
    outputs = {port(name) for name in wiring.output_pins}
    after_fall = _dependents(evaluation, pins)
    after_rise = _dependents(evaluation, {*pins, *registers})
    clocks = {_whole(name, evaluation, members) for name in evaluation.at_edge} - {clock}
    other_resets = [
        condition for condition, reset in evaluation.resets.items() if not reset <= {*registers}
    ]
    foreign = clocks | {*_NAME.findall(" ".join(other_resets))}
    if wiring.contention is not None:
        foreign.add(port(wiring.contention))
    offered = _dependents(evaluation, {port(memory["D_I"]) for memory in wiring.memories})
    if "" in clocks or foreign & (after_rise | offered) or outputs & offered:
        return None

    now = f"prev_{clock} = {clock};\n" if blocks else ""
    # A clock that is already high has no edge.
    rise = f"if (!posedge_{clock}()) {{ fall({tag}()); return false; }}\n" if blocks else ""
    rise += now + "bool changed = false;\n{\n" + _assignments(evaluation, set())
    for name in registers:
        rise += f"{members[name].replace('wire', 'value')} next_{name} = {name}.curr;\n"
    for block in blocks:
        rise += _NEXT.sub(r"next_\1 = ", block.replace(f"if (posedge_{clock}) ", "", 1)) + "\n"
    for name in registers:
        rise += f"if (Compare) changed |= {name}.curr != next_{name};\n"
        rise += f"{name}.curr = next_{name};\n"
    rise += "}\n" + _assignments(evaluation, after_rise & outputs) + "return changed;\n"
    return _Steps(
        " || ".join(c for c, reset in evaluation.resets.items() if reset & {*registers}) or "false",
        rise,
        now + _assignments(evaluation, after_fall & outputs),
        [any(port(memory[pin]) in after_rise for pin in MEMORY_PINS) for memory in wiring.memories],
        registers,
    )


def _whole(clock: str, evaluation: _Evaluation, members: dict[str, str]) -> str:
    """Name of the net of a clock that may be one bit of it, as in ``p_net_0``; empty if unknown."""
    known = {*evaluation.types, *members}
    return next((n for n in (clock, re.sub(r"_\d+$", "", clock)) if n in known), "")


def _dependents(evaluation: _Evaluation, names: set[str]) -> set[str]:
    """All names that depend on ``names``, directly or indirectly, and these themselves."""
    dependents = set(names)
    for name, expression in evaluation.assignments:
        if dependents & {*_NAME.findall(expression)}:
            dependents.add(name)
    return dependents


def _assignments(evaluation: _Evaluation, wanted: set[str]) -> str:
    """All assignments; those to names not in ``wanted`` set local variables instead."""
    text = "".join(
        f"{kind} {name};\n" for name, kind in evaluation.types.items() if name not in wanted
    )
    return text + "".join(f"{name} = {text};\n" for name, text in evaluation.assignments)

"""Generates C++ of a design's strides for driver.cpp: whether one can begin, and its end state.

A stride is declared with its design, and proved (:mod:`cubestack.hdl.blocks.pinned`); driver.cpp
performs its memory accesses.
"""

import re
from collections.abc import Mapping

from cubestack.emulator.rtl.cxxrtl.clock_steps import port
from cubestack.emulator.rtl.wiring import Levels, Wiring
from cubestack.hdl.blocks.pinned import Stride

_ESCAPE = re.compile("__|_([0-9a-f]{2})_")


def stride_table(wiring: Wiring) -> str:
    """C++ table of the strides, for all translations of the design.

    STRIDE_COUNT, and ``Stride<K>`` with the numbers of its camera (-1 for the data clock) and its
    memory, and the last value of its counter.
    """
    strides = wiring.component.strides
    text = f"#define STRIDE_COUNT {len(strides)}\ntemplate <int K> struct Stride;\n"
    clocks = [camera.clock for camera in wiring.cameras]
    memories = [memory["A"] for memory in wiring.memories]
    for number, stride in enumerate(strides):
        camera = clocks.index(stride.clock) if stride.stores else -1
        memory = memories.index(f"{stride.memory}_A")
        constants = f"static constexpr int camera = {camera}, memory = {memory};"
        text += (
            f"// {stride}\ntemplate <> struct Stride<{number}> {{ {constants} "
            f"static constexpr int64_t last = {stride.last}; }};\n"
        )
    return text


def stride_functions(
    wiring: Wiring, namespace: str, members: Mapping[str, str], fixed: Levels = ()
) -> str:
    """C++ functions for one translation of the design, which has ``members`` and ``fixed`` pins.

    - stride_ready(k, top): whether pins and registers have the stride's levels; false if the
      translation lacks one of them.
    - stride_counter(k, top): the counter; stride_to(k, top, counter, data) sets the end state.
    """
    found = {path_of(member): member for member in members}
    text = ""
    for number, stride in enumerate(wiring.component.strides):
        tag = f"std::integral_constant<int, {number}>"
        text += _functions(tag, namespace, stride, members, found, dict(fixed))
    return text


def path_of(member: str) -> str:
    """A register's path in the design, from its name in CXXRTL's class."""
    name = member.removeprefix("p_")
    return _ESCAPE.sub(lambda match: chr(int(match[1], 16)) if match[1] else "_", name)


def _functions(
    tag: str,
    namespace: str,
    stride: Stride,
    members: Mapping[str, str],
    found: Mapping[str, str],
    fixed: Mapping[str, int],
) -> str:
    levels = {port(pin): level for pin, level in stride.levels if pin not in fixed}
    levels |= {found.get(path, ""): level for path, level in stride.state}
    contradicted = any(fixed.get(pin, level) != level for pin, level in stride.levels)
    counter, data = (f"top.{found.get(path, '')}" for path in (stride.counter, stride.data))
    needed = {*levels, found.get(stride.counter, ""), found.get(stride.data, "")}
    take = f"({tag}, const {namespace}::p_top &top)"
    if contradicted or not needed <= {*members}:
        return (
            f"inline bool stride_ready{take} {{ (void)top; return false; }}\n"
            f"inline int64_t stride_counter{take} {{ (void)top; return 0; }}\n"
            f"inline void stride_to({tag}, {namespace}::p_top &, int64_t, uint8_t) {{}}\n"
        )
    conditions = (
        f"top.{name}{'.curr' if members[name].startswith('wire') else ''}"
        f".template get<uint32_t>() == {level}u"
        for name, level in levels.items()
    )
    return (
        f"inline bool stride_ready{take} {{ return {' && '.join(conditions)}; }}\n"
        f"inline int64_t stride_counter{take} "
        f"{{ return {counter}.curr.template get<uint32_t>(); }}\n"
        f"inline void stride_to({tag}, {namespace}::p_top &top, int64_t counter, uint8_t data) {{\n"
        f"{counter}.curr.template set<uint32_t>((uint32_t)counter);\n"
        f"{counter}.next = {counter}.curr;\n"
        f"{data}.curr.template set<uint8_t>(data); {data}.next = {data}.curr;\n}}\n"
    )

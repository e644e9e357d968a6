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
    memory, whether it stores, the level of the camera's line pin, the last value of its counter
    (-1 without one), and the limit of its data.
    """
    strides = wiring.component.strides
    text = f"#define STRIDE_COUNT {len(strides)}\ntemplate <int K> struct Stride;\n"
    cameras = {camera.clock: number for number, camera in enumerate(wiring.cameras)}
    lines = {camera.line for camera in wiring.cameras}
    memories = [memory["A"] for memory in wiring.memories]
    for number, stride in enumerate(strides):
        constants = {
            "camera": cameras.get(stride.clock, -1),
            "memory": memories.index(f"{stride.memory}_A"),
            "stores": int(stride.access == "store"),
            "line": max((level for pin, level in stride.levels if pin in lines), default=0),
            "last": stride.last if stride.counter else -1,
            "below": stride.below,
        }
        listed = ", ".join(f"{name} = {value}" for name, value in constants.items())
        text += (
            f"// {stride}\ntemplate <> struct Stride<{number}> "
            f"{{ static constexpr int {listed}; }};\n"
        )
    return text


def stride_functions(
    wiring: Wiring, namespace: str, members: Mapping[str, str], fixed: Levels = ()
) -> str:
    """C++ functions for one translation of the design, which has ``members`` and ``fixed`` pins.

    - stride_ready(k, top): whether pins and registers have the stride's levels; false if the
      translation lacks one of them.
    - stride_counter(k, top): the counter, 0 without one; stride_to(k, top, counter, data) sets the
      end state.
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
    changed = {path: found.get(path, "") for path in (stride.counter, stride.data) if path}
    needed = {*levels, *changed.values()}
    take = f"({tag}, const {namespace}::p_top &top)"
    if contradicted or not needed <= {*members}:
        return (
            f"inline bool stride_ready{take} {{ (void)top; return false; }}\n"
            f"inline int64_t stride_counter{take} {{ (void)top; return 0; }}\n"
            f"inline void stride_to({tag}, {namespace}::p_top &, int64_t, uint8_t) {{}}\n"
        )
    conditions = [
        f"top.{name}{'.curr' if members[name].startswith('wire') else ''}"
        f".template get<uint32_t>() == {level}u"
        for name, level in levels.items()
    ]
    data, counter = f"top.{changed[stride.data]}", f"top.{changed.get(stride.counter, '')}"
    conditions.append(f"{data}.curr.template get<uint32_t>() < {stride.below}u")
    counted, count = "0", ""
    if stride.counter:
        counted = f"{counter}.curr.template get<uint32_t>()"
        count = (
            f"{counter}.curr.template set<uint32_t>((uint32_t)counter);\n"
            f"{counter}.next = {counter}.curr;\n"
        )
    return (
        f"inline bool stride_ready{take} {{ return {' && '.join(conditions)}; }}\n"
        f"inline int64_t stride_counter{take} {{ (void)top; return {counted}; }}\n"
        f"inline void stride_to({tag}, {namespace}::p_top &top, int64_t counter, uint8_t data) {{\n"
        f"(void)counter;\n{count}"
        f"{data}.curr.template set<uint8_t>(data); {data}.next = {data}.curr;\n}}\n"
    )

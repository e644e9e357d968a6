"""Generates pins.h, the wiring as C++, for driver.cpp."""

import re
from collections.abc import Sequence

from cubestack.emulator.rtl.cxxrtl.clock_steps import clock_steps, port
from cubestack.emulator.rtl.cxxrtl.strides import path_of, stride_functions, stride_table
from cubestack.emulator.rtl.cxxrtl.variants import input_names, members
from cubestack.emulator.rtl.wiring import MEMORY_PINS, BusPins, CameraPins, MemoryPins, Wiring


def pins_header(wiring: Wiring, design: str, variants: Sequence[str] = ()) -> str:
    """Text of pins.h; ``design`` is CXXRTL's C++ of the wiring's component.

    ``variants`` are those of the design at each of the wiring's burst levels.

    - PINS: INPUT(name, port, initial level) and OUTPUT(name, port) of every pin.
    - CAMERAS: CAMERA(number, clock, data, line, statement that sets the frame pin to ``level``).
    - MEMORIES: MEMORY(number, A, D_I, D_O, D_OE, CE_N, OE_N, WE_N).
    - DATA_CLOCK, DATA: pins of the transfer loop; DATA_CLOCK_NUMBER: the number of its clock.
    - BUS_HIGH, BUS_LOW_I, BUS_LOW_O, BUS_LOW_OE, BUS_LATCH, BUS_READ, BUS_WRITE: pins of the
      external bus, if there is one; BUS_SELECTS: SELECT(number, port) of every chip select.
    - ACKNOWLEDGES, CONTENTION: levels in one word each.
    - FOREIGN: whether it is a user's design, of which nothing is known.
    - REGISTERS: REGISTER(name, port, bits) of every register.
    - derived_edge(top): whether a clock that is not a pin has an edge that takes effect;
      forget_derived_edges(top) clears these edges, and forget_edges(top) those of the pins too.
    - VARIANTS: VARIANT(number) of each. suits_0(top): whether the pins of the design have the
      variant's levels; same_0(a, b): whether outputs agree; copy_0(from, to) copies all state that
      can change; hold_0(from, to) copies the rest. The variant's class is from clock_steps.py.
    - the output of strides.py for the design and for each variant.
    """
    acknowledges = " | ".join(
        f"{_level(pin)} << {bit}" for bit, pin in enumerate(wiring.acknowledges)
    )
    definitions = {
        "PINS": " \\\n    ".join(_pin(wiring, name) for name in wiring.widths),
        "CAMERA_COUNT": str(len(wiring.cameras)),
        "CAMERAS": " ".join(_camera(n, camera) for n, camera in enumerate(wiring.cameras)),
        "MEMORY_COUNT": str(len(wiring.memories)),
        "MEMORIES": " ".join(_memory(n, memory) for n, memory in enumerate(wiring.memories)),
        "DATA_CLOCK_NUMBER": str(list(wiring.widths).index(wiring.data_clock)),
        "DATA_CLOCK": port(wiring.data_clock),
        "DATA": port(wiring.data),
        "ACKNOWLEDGES": f"({acknowledges})",
        "CONTENTION": "0u" if wiring.contention is None else _level(wiring.contention),
        "FOREIGN": "true" if wiring.foreign else "false",
        "REGISTERS": " \\\n    ".join(_registers(design)),
        **_bus(wiring.bus),
        "VARIANTS": " ".join(f"VARIANT({n})" for n in range(len(variants))),
    }
    text = "".join(f"#define {name} {text}\n" for name, text in definitions.items())
    text += _derived_edges(wiring, design, "cxxrtl_design") + stride_table(wiring)
    text += stride_functions(wiring, "cxxrtl_design", members(design) if design else {})
    for number, variant in enumerate(variants):
        text += _variant(wiring, design, variant, number)
    return text


def _level(name: str, model: str = "top") -> str:
    return f"{model}.{port(name)}.template get<uint32_t>()"


def _pin(wiring: Wiring, name: str) -> str:
    if name in wiring.initial:
        return f'INPUT("{name}", {port(name)}, {wiring.initial[name]}u)'
    return f'OUTPUT("{name}", {port(name)})'


def _camera(number: int, camera: CameraPins) -> str:
    ports = ", ".join(port(pin) for pin in (camera.clock, camera.data, camera.line))
    frame = "(void)level" if camera.frame is None else f"top.{port(camera.frame)}.set<bool>(level)"
    return f"CAMERA({number}, {ports}, {frame})"


def _memory(number: int, memory: MemoryPins) -> str:
    return f"MEMORY({number}, {', '.join(port(memory[pin]) for pin in MEMORY_PINS)})"


def _bus(bus: BusPins | None) -> dict[str, str]:
    if bus is None:
        return {}
    pins = {
        "HIGH": bus.high,
        **{f"LOW_{side}": f"{bus.low}_{side}" for side in ("I", "O", "OE")},
        "LATCH": bus.latch,
        "READ": bus.read,
        "WRITE": bus.write,
    }
    selects = (f"SELECT({number}, {port(name)})" for number, name in enumerate(bus.selects))
    return {
        **{f"BUS_{name}": port(pin) for name, pin in pins.items()},
        "BUS_SELECTS": " ".join(selects),
    }


def _registers(design: str) -> list[str]:
    """CXXRTL's buffered wires are the registers; it escapes special characters in names."""
    kinds = members(design).items() if design else ()
    wires = [(member, kind) for member, kind in kinds if kind.startswith("wire")]
    return [f'REGISTER("{path_of(member)}", {member}, {kind[5:-1]})' for member, kind in wires]


def _derived_edges(wiring: Wiring, design: str, namespace: str) -> str:
    """Edge detectors of CXXRTL, without those of the pins."""
    pins = {port(name) for name in wiring.initial}
    detectors = re.findall(r"bool ((?:pos|neg)edge_(\w+))\(\) const", design)
    edges = [f"top.{detector}()" for detector, clock in detectors if clock not in pins]
    levels = re.findall(r"prev_(\w+) = (\1(?:\.curr)?);", design)
    clocks = [(clock, level) for clock, level in levels if clock not in pins]
    forget, forget_all = (
        " ".join(f"top.prev_{clock} = top.{level};" for clock, level in some)
        for some in (clocks, levels)
    )
    return (
        f"inline bool derived_edge(const {namespace}::p_top &top) "
        f"{{ (void)top; return {' || '.join(edges) or 'false'}; }}\n"
        f"inline void forget_derived_edges({namespace}::p_top &top) {{ (void)top; {forget} }}\n"
        f"inline void forget_edges({namespace}::p_top &top) {{ (void)top; {forget_all} }}\n"
    )


def _variant(wiring: Wiring, design: str, variant: str, number: int) -> str:
    namespace = f"cxxrtl_variant_{number}"
    whole, part = members(design), members(variant)
    shared = [
        name + side
        for name, kind in part.items()
        if whole.get(name) == kind
        for side in ((".curr", ".next") if kind.startswith("wire") else ("",))
    ]
    holding = " ".join(
        f"to.{name} = from.{name}.curr;"
        for name in input_names(variant)
        if whole.get(name, "").startswith("wire")
    )
    suits = " && ".join(f"{_level(pin)} == {level}u" for pin, level in wiring.burst_levels[number])
    same = " && ".join(f"{_level(pin, 'a')} == {_level(pin, 'b')}" for pin in wiring.output_pins)
    return (
        f"#define cxxrtl_design {namespace}\n"
        f"#define cxxrtl_design_create {namespace}_create\n"
        f'#include "variant_{number}.cpp"\n'
        "#undef cxxrtl_design\n"
        "#undef cxxrtl_design_create\n"
        + _derived_edges(wiring, variant, namespace)
        + f"inline bool suits_{number}(const cxxrtl_design::p_top &top) {{ return {suits}; }}\n"
        "template <class A, class B> "
        f"bool same_{number}(const A &a, const B &b) {{ return {same}; }}\n"
        "template <class From, class To> "
        f"void copy_{number}(const From &from, To &to) "
        f"{{ {' '.join(f'to.{name} = from.{name};' for name in shared)} }}\n"
        "template <class From, class To> "
        f"void hold_{number}(const From &from, To &to) "
        f"{{ (void)from, (void)to; {holding} }}\n"
        + stride_functions(wiring, namespace, part, wiring.burst_levels[number])
        + clock_steps(wiring, variant, dict(part), number)
    )

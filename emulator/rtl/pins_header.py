"""The wiring as C++, for driver.cpp to include: pins.h."""

import re

from cubestack.emulator.rtl.wiring import CameraPins, MemoryPins, Wiring

__all__ = ["pins_header"]

_MEMORY_PINS = ("A", "D_I", "D_O", "D_OE", "CE_N", "OE_N", "WE_N")


def pins_header(wiring: Wiring, design: str) -> str:
    """Text of pins.h; ``design`` is CXXRTL's C++ of the wiring's component.

    - PINS: INPUT(name, port, initial level) and OUTPUT(name, port) of every pin.
    - CAMERAS: CAMERA(number, clock, data, line, how the frame pin follows ``level``).
    - MEMORIES: MEMORY(number, A, D_I, D_O, D_OE, CE_N, OE_N, WE_N).
    - DATA_CLOCK_NAME, DATA_CLOCK, DATA: of the transfer loop.
    - ACKNOWLEDGES, CONTENTION: levels in one word each.
    - DERIVED_EDGE: whether a clock that is no pin has an edge that takes effect.
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
        "DATA_CLOCK_NAME": f'"{wiring.data_clock}"',
        "DATA_CLOCK": _port(wiring.data_clock),
        "DATA": _port(wiring.data),
        "ACKNOWLEDGES": f"({acknowledges})",
        "CONTENTION": "0u" if wiring.contention is None else _level(wiring.contention),
        "DERIVED_EDGE": _derived_edge(wiring, design),
    }
    return "".join(f"#define {name} {text}\n" for name, text in definitions.items())


def _port(name: str) -> str:
    """Member of CXXRTL's class."""
    return "p_" + name.replace("_", "__")


def _level(name: str) -> str:
    return f"top.{_port(name)}.get<uint32_t>()"


def _pin(wiring: Wiring, name: str) -> str:
    if name in wiring.initial:
        return f'INPUT("{name}", {_port(name)}, {wiring.initial[name]}u)'
    return f'OUTPUT("{name}", {_port(name)})'


def _camera(number: int, camera: CameraPins) -> str:
    ports = ", ".join(_port(pin) for pin in (camera.clock, camera.data, camera.line))
    frame = "(void)level" if camera.frame is None else f"top.{_port(camera.frame)}.set<bool>(level)"
    return f"CAMERA({number}, {ports}, {frame})"


def _memory(number: int, memory: MemoryPins) -> str:
    return f"MEMORY({number}, {', '.join(_port(memory[pin]) for pin in _MEMORY_PINS)})"


def _derived_edge(wiring: Wiring, design: str) -> str:
    """Asks CXXRTL's own edge detectors, but for those of the pins."""
    pins = {_port(name) for name in wiring.initial}
    detectors = re.findall(r"bool ((?:pos|neg)edge_(\w+))\(\) const", design)
    derived = [f"top.{detector}()" for detector, clock in detectors if clock not in pins]
    return f"({' || '.join(derived)})" if derived else "false"

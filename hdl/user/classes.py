"""Creates a user's Amaranth component from the name of its class."""

import inspect
import sys
from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from amaranth.hdl import Fragment
from amaranth.lib.wiring import Component, Out

from cubestack.firmware_model.interface.pins import Pin
from cubestack.hdl.user.source import VERSION, ClassName, GatewareError, check_version


def make_component(
    wanted: ClassName,
    pins: Iterable[Pin],
    parameters: Mapping[str, Any],
    folder: Path | None = None,
) -> Any:
    """The component, whose ports are those of ``pins`` and further outputs; GatewareError."""
    name = f"{wanted.module}:{wanted.name}"
    kind = _load(wanted, name, str((folder or Path()).resolve()))
    check_version(name, getattr(kind, VERSION, None))
    known = [
        parameter.name
        for parameter in inspect.signature(kind).parameters.values()
        if parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
    ]
    # Verilog's ROWS is usually rows in Python.
    names = {parameter.lower(): parameter for parameter in known}
    for parameter in parameters:
        if parameter.lower() not in names:
            words = ", ".join(known) or "none"
            raise GatewareError(f"{name}: no parameter {parameter}; parameters: {words}")
    try:
        component = kind(**{names[key.lower()]: value for key, value in parameters.items()})
        Fragment.get(component, None)
    except Exception as error:
        raise GatewareError(f"{name}: {type(error).__name__}: {error}") from error
    misfits = [*_misfits(component, tuple(pins))]
    if misfits:
        raise GatewareError("\n".join(f"{name}: {misfit}" for misfit in misfits))
    return component


def _load(wanted: ClassName, name: str, folder: str) -> type[Component]:
    sys.path.insert(0, folder)
    try:
        module = import_module(wanted.module)
    except Exception as error:
        raise GatewareError(f"{name}: {type(error).__name__}: {error}") from error
    finally:
        sys.path.remove(folder)
    kind = getattr(module, wanted.name, None)
    if not isinstance(kind, type) or not issubclass(kind, Component):
        classes = [
            n for n, v in vars(module).items() if isinstance(v, type) and issubclass(v, Component)
        ]
        found = ", ".join(n for n in classes if n != "Component") or "none"
        raise GatewareError(
            f"{name}: {wanted.name} is no amaranth.lib.wiring.Component; the module has {found}"
        )
    return kind


def _misfits(component: Component, pins: tuple[Pin, ...]) -> Iterator[str]:
    found = {
        name: ("output" if member.flow is Out else "input", len(getattr(component, name)))
        for name, member in component.signature.members.items()
        if member.is_port
    }
    wanted = {port.name: port for pin in pins for port in pin.ports}
    for name, port in wanted.items():
        direction = "output" if port.output else "input"
        if found.get(name) != (direction, port.width):
            shown = _words(*found[name]) if name in found else "none"
            yield f"pin {name}: wanted {_words(direction, port.width)}, found {shown}"
    for name, (direction, width) in found.items():
        if name not in wanted and direction == "input":
            yield f"pin {name}: found {_words(direction, width)}, but the board has no such pin"


def _words(direction: str, width: int) -> str:
    return f"{direction} of {width} bit{'s' * (width > 1)}"

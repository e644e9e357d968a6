"""Checks of the declaration of a sensor; each mistake is reported in one line.

The line names the file or entry point, the message or field, and what is expected. The tables
themselves reject the rest (two messages with one ID, a reset value beyond its limits) with an
`InterfaceError`.
"""

import ast
import inspect
import os
import sys
from collections.abc import Callable, Collection, Iterable, Mapping
from functools import partial
from types import TracebackType
from typing import Any

from cubestack.firmware_model.interface.codec.field import InterfaceError, suggestion
from cubestack.firmware_model.interface.codec.message import Interface, Message

NEEDED = ("host_message", "i2c_interrupt", "port_read", "port_write", "uart_interrupt")
"""Operations of every node's program."""

ADDRESSES = range(0x08, 0x78)
"""I2C addresses of 7 bits that are not reserved."""

CHARGING = ("charge", "book")
"""Methods of a meter whose keywords are operations."""


class SensorError(ValueError):
    """A mistake in the declaration of a sensor; the text is one line."""


def check_interface(interface: Interface) -> None:
    """Require a meaning of every message and field."""
    for message in interface.messages:
        if not message.meaning:
            raise SensorError(f"{_titled(message)} has no meaning; add a phrase for a reader")
        for field in message.fields:
            if not field.meaning:
                raise SensorError(
                    f"{_titled(message)}: field {field.name} has no meaning; "
                    "add a phrase for a reader"
                )


def check_address(interface: Interface, others: Iterable[Interface]) -> None:
    """Require an I2C address that no other device has, and that is not reserved."""
    address = f"{interface.name}: I2C address {interface.i2c_address:#04x}"
    if interface.i2c_address not in ADDRESSES:
        raise SensorError(f"{address} must be {ADDRESSES[0]:#04x} to {ADDRESSES[-1]:#04x}")
    for other in others:
        taken = [other.i2c_address]
        if other.registers is not None:
            taken.append(other.registers.i2c_address)
        if interface.i2c_address in taken:
            raise SensorError(f"{address} is in use by {other.name}; choose another i2c_address")


def check_class(owner: type[Any], **attributes: str) -> None:
    """Require these attributes of a class; the values describe them."""
    for name, wanted in attributes.items():
        if not hasattr(owner, name):
            raise SensorError(f"{_file(owner)}: {owner.__name__} has no {name}: {wanted}")


def check_actions(
    owner: type[Any], interface: Interface, actions: Mapping[str, Callable[..., Any]]
) -> None:
    """Require generator functions, each under the name of a telecommand."""
    known = [message.name for message in interface.telecommands]
    for name, action in actions.items():
        _check_name(f"{_file(owner)}: {owner.__name__}.actions()", name, "telecommand", known)
        if not inspect.isgeneratorfunction(action):
            raise SensorError(
                f"{place(action, owner)}: the action of telecommand {name} is no generator "
                "function; yield what takes time, or Pay()"
            )


def check_sources(
    owner: type[Any], interface: Interface, sources: Mapping[str, Callable[[], dict[str, Any]]]
) -> None:
    """Require a source for each telemetry message, and values that fit.

    Calls all sources, except those of messages that change something when they are read.
    """
    at = f"{_file(owner)}: {owner.__name__}.sources()"
    known = [message.name for message in interface.telemetries]
    for name in sources:
        _check_name(at, name, "telemetry", known)
    for message in interface.telemetries:
        if not message.supported:
            continue
        if message.name not in sources:
            raise SensorError(f"{at} has no source of {_titled(message)}; add {message.name!r}")
        source = sources[message.name]
        if not message.has_side_effect:
            check_values(message, source(), partial(place, source, owner))


def check_values(message: Message, values: Any, where: Callable[[], str]) -> None:
    """Require one value for each field of a telemetry message, and that each fits its type.

    ``where`` returns the place of the source.
    """
    names = [field.name for field in message.fields]
    if not isinstance(values, dict) or values.keys() != set(names):
        given = ", ".join(values) if isinstance(values, dict) else repr(values)
        raise SensorError(
            f"{where()}: the source of {_titled(message)} must return {', '.join(names)}, "
            f"not {given or 'nothing'}"
        )
    for field in message.fields:
        try:
            field.encode(values[field.name], saturate=False)
        except InterfaceError as error:
            raise SensorError(f"{where()}: {_titled(message)}, {error}") from None


def check_charges(owner: type[Any], operations: Collection[str], processor: str) -> None:
    """Require that a cost table has the operations of every node, and those of a program.

    The latter are the keywords with which the modules of its classes call `Meter.charge`.
    """
    if missing := sorted({*NEEDED} - {*operations}):
        raise SensorError(
            f"{_file(owner)}: the costs of {processor} need {', '.join(missing)} for every node"
        )
    for base in owner.__mro__:
        for name, line in _charged(base.__module__) if _is_foreign(base) else ():
            if name not in operations:
                raise SensorError(
                    f"{line}: no operation {name!r} in the costs of {processor}; "
                    f"{suggestion(name, sorted(operations))}"
                )


def check_supplies(owner: type[Any], states: Mapping[str, Collection[str]]) -> None:
    """Require a part "processor" with the states of a running program, given states by part."""
    if not {"sleep", "run"} <= set(states.get("processor", ())):
        raise SensorError(
            f"{_file(owner)}: supplies of {owner.__name__} need a part 'processor' with the "
            "currents 'sleep' and 'run'"
        )


def place_of(traceback: TracebackType | None, package: str) -> str:
    """The last line of ``package`` in a traceback, as "file:line: "; empty if there is none."""
    found = ""
    while traceback is not None:
        frame = traceback.tb_frame
        if str(frame.f_globals.get("__name__")).split(".")[0] == package:
            found = f"{shown_path(frame.f_code.co_filename)}:{traceback.tb_lineno}: "
        traceback = traceback.tb_next
    return found


def shown_path(file: str) -> str:
    """A file's path, relative to the current folder if it is below that."""
    relative = os.path.relpath(file)
    return file if relative.startswith(os.pardir) else relative


def _check_name(at: str, name: str, kind: str, known: list[str]) -> None:
    if name not in known:
        raise SensorError(f"{at} has {name!r}, which is no {kind}; {suggestion(name, known)}")


def _titled(message: Message) -> str:
    return f"{message.kind.value} {message.id} {message.name}"


def _is_foreign(owner: type[Any]) -> bool:
    return owner.__module__.split(".")[0] not in ("cubestack", "builtins", "abc", "typing")


def _charged(module: str) -> tuple[tuple[str, str], ...]:
    """Operations that a module charges by keyword, each with file and line."""
    try:
        source = inspect.getsource(sys.modules[module])
    except (OSError, TypeError, KeyError):
        return ()
    file = shown_path(str(sys.modules[module].__file__))
    return tuple(
        (keyword.arg, f"{file}:{keyword.lineno}")
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and node.func.attr in CHARGING
        for keyword in node.keywords
        if keyword.arg is not None
    )


def place(function: Callable[..., Any], owner: type[Any]) -> str:
    """File and line of a function; only the file of its class if it is not a sensor's own."""
    code = getattr(inspect.unwrap(function), "__code__", None)
    if code is None or not _is_foreign(owner):
        return _file(owner)
    return f"{shown_path(code.co_filename)}:{code.co_firstlineno}"


def _file(owner: type[Any]) -> str:
    return shown_path(str(getattr(sys.modules.get(owner.__module__), "__file__", owner.__module__)))

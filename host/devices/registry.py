"""All registered devices by name: built-in ones and those of other distributions.

A *part* is a microcontroller without a sensor around it: it can be emulated with a user's own
firmware, but has no messages, so commands that speak a device's protocol do not list it.

Another distribution registers a device by an entry point in the group ``cubestack.devices``: its
name is the device's, its value leads to a ``Device``. Texts ``"package.module:name"`` name what is
imported on first use.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cache, partial
from importlib.metadata import EntryPoint, entry_points
from pkgutil import resolve_name
from typing import Any, TypeVar

from cubestack.firmware_model.interface.checks import check_address, check_interface, place_of
from cubestack.host.devices.device import AnyDevice, Device
from cubestack.host.errors import TargetError


def load(what: str) -> Any:
    """Load it; on failure, raises TargetError with file and line."""
    try:
        return resolve_name(what)
    except Exception as error:
        place = place_of(error.__traceback__, what.split(".")[0].split(":")[0])
        kind = "" if isinstance(error, ValueError | ImportError) else f"{type(error).__name__}: "
        raise TargetError(f"{what} does not load: {place}{kind}{error}") from error


def get(what: str) -> Callable[[], Any]:
    return partial(load, what)


def call(what: str, *first: Any, **always: Any) -> Callable[..., Any]:
    """A callable that passes these arguments, then its own, to the named function."""

    def called(*given: Any, **options: Any) -> Any:
        return load(what)(*first, *given, **always, **options)

    return called


V = TypeVar("V")

GROUP = "cubestack.devices"

#: Built-in devices, in the order of all lists.
BUILT_IN = ("cubestar", "cubesense", "aramis")

#: Built-in parts.
PARTS = ("efm32gg",)


@cache
def _entries() -> dict[str, EntryPoint]:
    """The declaration of each device; the first to claim a name has it."""
    entries = {
        name: EntryPoint(name, f"cubestack.host.sensors.{name}:DEVICE", GROUP) for name in BUILT_IN
    }
    for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name):
        entries.setdefault(entry.name, entry)
    return entries


@cache
def _parts() -> dict[str, EntryPoint]:
    return {name: EntryPoint(name, f"cubestack.host.parts.{name}:DEVICE", GROUP) for name in PARTS}


def device_names() -> tuple[str, ...]:
    """Names of all registered sensors; loads none of them."""
    return tuple(_entries())


def emulated_names() -> tuple[str, ...]:
    """Names of all that can be emulated: sensors, then parts."""
    return (*_entries(), *_parts())


@cache
def device(name: str) -> AnyDevice:
    """The sensor or part of this name in any case; TargetError if unknown or not loadable."""
    entry = {**_parts(), **_entries()}.get(name.lower())
    if entry is None:
        raise TargetError(f"no device {name!r}; known: {', '.join(emulated_names())}")
    try:
        found = load(entry.value)
        if not isinstance(found, Device) or found.name != entry.name:
            raise TargetError(f"{entry.value} is no Device of that name")
    except TargetError as error:
        raise TargetError(f"device {name}: {error}") from error
    if entry.name not in (*BUILT_IN, *PARTS):
        _check(found, entry.value)
    return found


def _check(found: AnyDevice, place: str) -> None:
    try:
        check_interface(found.interface)
        check_address(found.interface, [device(name).interface for name in BUILT_IN])
    except ValueError as error:
        raise TargetError(f"device {found.name}: {place}: {error}") from None


def devices(names: Iterable[str] | None = None) -> Iterator[AnyDevice]:
    """Those of ``names`` that load, by default all sensors; ``device`` reports why not."""
    for name in device_names() if names is None else names:
        try:
            yield device(name)
        except TargetError:
            continue


def merged_tables(table: Callable[[AnyDevice], Mapping[str, V]]) -> dict[str, V]:
    """The entries of a table that each device has; leaves out tables that do not load."""
    found: dict[str, V] = {}
    for one in devices():
        with suppress(TargetError):
            found |= table(one)
    return found

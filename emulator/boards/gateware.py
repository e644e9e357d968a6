"""A user's own design in place of the shipped one of a board."""

import json
import warnings
from collections.abc import Callable, Collection, Iterable, Mapping
from functools import cache
from typing import Any

from cubestack.emulator.native.cache import cache_folder, hash_of
from cubestack.emulator.rtl.wiring import CameraPins, Level, Wiring
from cubestack.firmware_model.interface.pins import Pin
from cubestack.hdl.blocks.pinned import RtlilComponent, Stride
from cubestack.hdl.flow.generate import design_hash
from cubestack.hdl.flow.tools import ToolMissingError
from cubestack.hdl.user import Gateware, GatewareError, load_gateware
from cubestack.hdl.user.copies import Cube, IdleCamera
from cubestack.hdl.user.idle import IdleVerdict, cubes_without, prove_idle
from cubestack.hdl.user.stored import source_hash, write_whole
from cubestack.hdl.user.strides import proved_strides, stride_fields, stride_of


class GatewareNotice(UserWarning):
    """What a user must know of the design."""


def with_gateware(wiring: Wiring, text: str, parameters: str = "") -> Wiring:
    """``wiring`` with the design that ``text`` names; with itself if that is empty.

    Warns of what a user must know of the design. Raises GatewareError, and ToolMissingError for
    Verilog without a whole Yosys.
    """
    if not text:
        if parameters:
            raise GatewareError("gateware_param needs a design of your own: choose one by gateware")
        return wiring
    gateware = load(text, wiring.component.pins, parameters)
    gateware.use_strides(_strides(wiring, gateware))
    return fitted(wiring, gateware)


def fitted(wiring: Wiring, gateware: RtlilComponent) -> Wiring:
    """``wiring`` with a user's design; warns of clocks that are simulated while it is idle."""
    idle = {camera.name: _idle(wiring, gateware, camera, stacklevel=4) for camera in wiring.cameras}

    def storing(level: Level) -> Collection[str]:
        return [name for name, is_idle in idle.items() if not is_idle(level)]

    return wiring.with_design(gateware, storing)


def _idle(
    wiring: Wiring, gateware: RtlilComponent, camera: CameraPins, stacklevel: int
) -> Callable[[Level], bool]:
    """When the camera's clock is proved to have no effect.

    At most while the shipped design's command does not last, whatever the acknowledges.
    """

    def commanded(level: Level) -> Collection[str]:
        return wiring.storing(lambda pin: 0 if pin in wiring.acknowledges else level(pin))

    cubes, refuted, moves = _verdict(wiring, gateware, camera, commanded)
    if refuted:
        when = " or ".join(map(_words, refuted)) if cubes else "at any time"
        warnings.warn(
            f"{gateware.title}: {camera.clock} may have an effect {when} ({moves}), "
            "so each of its clocks is simulated then, which is slower",
            GatewareNotice,
            stacklevel=stacklevel,
        )
    pins = [*dict.fromkeys(pin for cube in cubes for pin in cube)]

    @cache
    def is_idle(*levels: int) -> bool:
        known = dict(zip(pins, levels, strict=True))
        return any(cube.items() <= known.items() for cube in cubes)

    return lambda level: is_idle(*map(level, pins))


def _words(cube: Cube) -> str:
    return f"with {' '.join(f'{pin}={level}' for pin, level in cube.items())}"


def _verdict(
    wiring: Wiring,
    gateware: RtlilComponent,
    camera: CameraPins,
    storing: Callable[[Level], Collection[str]],
) -> IdleVerdict:
    cubes = cubes_without(camera.name, storing)
    masked = {memory["D_O"]: memory["D_OE"] for memory in wiring.memories}
    pins = idle_camera(wiring, camera)
    call = f"{design_hash(gateware)} {pins} {cubes} {masked}"
    try:
        found = _kept(call, lambda: prove_idle(gateware, pins, cubes, masked))
    except (ToolMissingError, TimeoutError) as error:
        return IdleVerdict([], cubes, f"no proof: {error}")
    return IdleVerdict(*found)


def idle_camera(wiring: Wiring, camera: CameraPins) -> IdleCamera:
    """Pins for the proof; an engine runs data clock and bus without a look at idle cameras."""
    syncs = tuple(pin for pin in camera.pins if pin != camera.data)
    bus = wiring.bus
    driven = () if bus is None else (*bus.selects, bus.high, bus.latch, bus.read, bus.write)
    strobed = {wiring.data_clock, *driven, *([f"{bus.low}_I"] if bus else [])}
    return IdleCamera(
        camera.data, syncs, tuple(pin for pin in wiring.mcu_pins if pin not in strobed)
    )


def _strides(wiring: Wiring, gateware: Gateware) -> list[Stride]:
    """Those of the shipped design that are proved of the user's; none without a whole Yosys."""
    shipped = wiring.component
    call = f"{design_hash(gateware)} {shipped.strides}"
    try:
        found = _kept(call, lambda: [*map(stride_fields, proved_strides(gateware, shipped))])
    except ToolMissingError:
        return []
    return [stride_of(fields) for fields in found]


def _kept(call: str, compute: Callable[[], Any]) -> Any:
    """What ``compute`` returns, as JSON has it; from the cache if it was computed before."""
    file = cache_folder() / "gateware" / f"{hash_of(f'{call} {source_hash()}'.encode())}.json"
    try:
        return json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        found = compute()
        write_whole(file, json.dumps(found))
        return found


def load(text: str, pins: Iterable[Pin], parameters: str = "") -> Gateware:
    """The design that ``text`` names, with ``pins``; warns and raises as :func:`with_gateware`."""
    given, folder = parse_parameters(parameters), cache_folder() / "gateware"
    gateware = load_gateware(text, pins, given, cache=folder)
    for notice in gateware.notices:
        warnings.warn(notice, GatewareNotice, stacklevel=4)
    return gateware


def parse_parameters(text: str) -> Mapping[str, int | str]:
    """Parameters from "NAME=VALUE,..."; numbers as in Python, other values are texts."""
    found: dict[str, int | str] = {}
    for part in text.split(",") if text else ():
        name, equals, value = part.partition("=")
        if not equals or not name.strip():
            raise GatewareError(f"a parameter of the gateware is NAME=VALUE, not {part!r}")
        found[name.strip()] = _value(value.strip())
    return found


def _value(text: str) -> int | str:
    try:
        return int(text, 0)
    except ValueError:
        return text

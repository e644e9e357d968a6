"""A user's own design in place of the shipped one of a board."""

import json
import warnings
from collections.abc import Mapping

from cubestack.emulator.native.cache import cache_folder, hash_of
from cubestack.emulator.rtl.wiring import CameraPins, Wiring
from cubestack.hdl.flow.generate import design_hash
from cubestack.hdl.flow.tools import ToolMissingError
from cubestack.hdl.user import Gateware, GatewareError, load_gateware
from cubestack.hdl.user.idle import IdleVerdict, cubes_without, prove_idle
from cubestack.hdl.user.stored import source_hash, write_whole


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
    gateware = load(wiring, text, parameters)
    return wiring.with_design(gateware, _steady_cameras(wiring, gateware))


def _steady_cameras(wiring: Wiring, gateware: Gateware) -> list[str]:
    """Cameras whose clocks provably have no effect while the shipped design would not store."""
    found = []
    for camera in wiring.cameras:
        verdict = _verdict(wiring, gateware, camera)
        if verdict.proved:
            found.append(camera.name)
        else:
            warnings.warn(
                f"{gateware.title}: {camera.clock} may have an effect at any time "
                f"({verdict.moves}), so each of its clocks is simulated, which is slower",
                GatewareNotice,
                stacklevel=5,
            )
    return found


def _verdict(wiring: Wiring, gateware: Gateware, camera: CameraPins) -> IdleVerdict:
    """From the cache, or proved now; not proved without a whole Yosys."""
    cubes = cubes_without(camera.name, wiring.storing)
    masked = {memory["D_O"]: memory["D_OE"] for memory in wiring.memories}
    call = f"{design_hash(gateware)} {camera.pins} {cubes} {masked} {source_hash()}"
    file = cache_folder() / "gateware" / f"{hash_of(call.encode())}.idle"
    try:
        return IdleVerdict(*json.loads(file.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        pass
    try:
        verdict = prove_idle(gateware, camera.pins, cubes, masked)
    except ToolMissingError as error:
        return IdleVerdict(False, f"no proof: {error}")
    write_whole(file, json.dumps(verdict))
    return verdict


def load(wiring: Wiring, text: str, parameters: str = "") -> Gateware:
    """The design with the pins of ``wiring``; warns and raises as :func:`with_gateware`."""
    given, folder = parse_parameters(parameters), cache_folder() / "gateware"
    gateware = load_gateware(text, wiring.component.pins, given, cache=folder)
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

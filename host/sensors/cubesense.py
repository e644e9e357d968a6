"""CubeSense as a registered device."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.host.clients.contract import Client
from cubestack.host.devices.device import BoardOption, ConformanceNotes, Device, Report

if TYPE_CHECKING:
    from cubestack.emulator.boards.cubesense.board import CubeSenseBoard
    from cubestack.emulator.camera.ov7620.view import EarthSunView
    from cubestack.emulator.scene.earth_sun import EarthSunScene
    from cubestack.hdl.flow.top import TopTable
    from cubestack.hdl.proofs.prover import Proof
    from cubestack.host.clients.cubesense.client import CubeSense

__all__ = ["DEVICE"]

SUN_DEG, NADIR_DEG = (20.0, 10.0), (-8.0, 12.0)


def _client(client: Client) -> CubeSense:
    from cubestack.host.clients.cubesense.client import CubeSense

    return CubeSense(client)


def _open_board(
    scene: EarthSunScene | EarthSunView,
    *,
    baud: int | None = None,
    mcu_addressing: bool = False,
    **common: Any,
) -> CubeSenseBoard:
    from cubestack.emulator.boards.cubesense.board import CubeSenseBoard

    return CubeSenseBoard(
        scene, baud=baud or INTERFACE.baud, mcu_addressing=mcu_addressing, **common
    )


def _load_scene(path: Path) -> EarthSunView:
    from cubestack.emulator.camera.ov7620.scene_file import load_earth_sun_scene

    return load_earth_sun_scene(path)


def _default_scene() -> EarthSunScene:
    from cubestack.emulator.scene.earth_sun import EarthSunScene

    return EarthSunScene.facing(sun_deg=SUN_DEG, nadir_deg=NADIR_DEG)


def _tops() -> TopTable:
    from cubestack.hdl.cubesense.tops import TOPS

    return TOPS


def _proofs() -> Mapping[str, Proof]:
    from cubestack.hdl.proofs.cubesense import PROOFS

    return PROOFS


def _lazily(what: str) -> Callable[[], Any]:
    """Gives something of this sensor's experiments, which are loaded then."""
    return partial(resolve_name, f"cubestack.host.experiments.cubesense.{what}")


DEVICE: Device[CubeSenseBoard, CubeSense] = Device(
    name="cubesense",
    title="CubeSense",
    summary="directions of the Sun and of the Earth's centre",
    interface=INTERFACE,
    client=_client,
    open_board=_open_board,
    load_scene=_load_scene,
    default_scene=_default_scene,
    default_scene_title="Earth and Sun",
    experiment=_lazily("measure:EXPERIMENT"),
    reports=(
        Report(
            "memory",
            "list the firmware's buffers against the processor's memories",
            _lazily("memory:EXPERIMENT"),
        ),
    ),
    benchmark=_lazily("benchmark:BENCHMARK"),
    demo=_lazily("demo:show"),
    options=(
        BoardOption(
            "mcu_addressing",
            "FPGAs that let the processor choose addresses (telecommand 100)",
        ),
    ),
    tops=_tops,
    proofs=_proofs,
    conformance=ConformanceNotes(
        keys=frozenset({"Area"}), optional=frozenset({"SetNadirSearch", "NADIR_SEARCH"})
    ),
)

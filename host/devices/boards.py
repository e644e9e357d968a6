"""Emulated devices as the commands that serve them see them: any device, its serial lines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from cubestack.firmware_model.interface.aramis import INTERFACE as ARAMIS
from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR
from cubestack.firmware_model.interface.cubestar.layouts import Layout

if TYPE_CHECKING:
    from cubestack.emulator.boards.contract import Board
    from cubestack.emulator.bus.i2c import I2cBus
    from cubestack.emulator.camera.common.view import SkyView
    from cubestack.emulator.camera.ov7620.view import EarthSunView
    from cubestack.emulator.scene.earth_sun import EarthSunScene
    from cubestack.emulator.scene.sky import Scene
    from cubestack.emulator.sim.virtual_time import Kernel
    from cubestack.host.cli.session import Engine

    Place = tuple[Kernel | None, I2cBus | None]

__all__ = [
    "DEVICES",
    "Opened",
    "cubesense_scene",
    "cubestar_scene",
    "open_board",
]

DEFAULT_POINTING_DEG = (84.0, -1.0, 0.0)  # Orion's belt
DEFAULT_MAG_LIMIT = 3.8
"""Stars of the onboard list only: with fainter ones in view, the threshold wants raising first."""

DEFAULT_ANGLES_DEG = {"sun": (20.0, 10.0), "nadir": (-8.0, 12.0)}


@dataclass(frozen=True)
class Opened:
    """A device that has been powered up."""

    title: str
    board: Board


def open_board(
    device: str,
    scene: Path | None,
    *,
    seed: int,
    engine: Engine,
    baud: int | None,
    mcu_addressing: bool = False,
    layout: Layout = Layout.COPIED,
    kernel: Kernel | None = None,
    i2c_bus: I2cBus | None = None,
) -> Opened:
    """Power up ``device`` (a name of ``DEVICES``); ``scene`` None is its default scene.

    ``baud`` is of the node protocol's line, None for the published one. ``mcu_addressing`` is an
    option of CubeSense's FPGAs, ``layout`` one of CubeStar; ValueError for another device.
    ``kernel`` and ``i2c_bus`` are what it shares with other devices, if anything.
    """
    place = kernel, i2c_bus
    if layout is not Layout.COPIED:
        if device != "cubestar":
            raise ValueError(f"--layout is an option of cubestar, not of {device}")
        return _cubestar(scene, seed, engine, baud, place, layout=layout)
    if mcu_addressing:
        if device != "cubesense":
            raise ValueError(f"--mcu-addressing is an option of cubesense, not of {device}")
        return _cubesense(scene, seed, engine, baud, place, mcu_addressing=True)
    return DEVICES[device](scene, seed, engine, baud, place)


def cubestar_scene(path: Path | None) -> Scene | SkyView:
    """The scene in ``path``; None is Orion's belt."""
    from cubestack.emulator.camera.common.scene_file import load_scene
    from cubestack.emulator.camera.mlx75412.lens import CONDITION
    from cubestack.emulator.scene.attitude import quaternion_from_pointing
    from cubestack.emulator.scene.sky import SkyScene

    if path is not None:
        return load_scene(path, CONDITION)
    return SkyScene(quaternion_from_pointing(*DEFAULT_POINTING_DEG), mag_limit=DEFAULT_MAG_LIMIT)


def cubesense_scene(path: Path | None) -> EarthSunScene | EarthSunView:
    """The scene in ``path``; None has Sun and Earth in view."""
    from cubestack.emulator.camera.ov7620.scene_file import load_earth_sun_scene
    from cubestack.emulator.scene.earth_sun import EarthSunScene

    if path is not None:
        return load_earth_sun_scene(path)
    angles = DEFAULT_ANGLES_DEG
    return EarthSunScene.facing(sun_deg=angles["sun"], nadir_deg=angles["nadir"])


def _cubestar(
    path: Path | None,
    seed: int,
    engine: Engine,
    baud: int | None,
    place: Place,
    *,
    layout: Layout = Layout.COPIED,
) -> Opened:
    from cubestack.emulator.boards.cubestar.board import CubeStarBoard
    from cubestack.emulator.boards.cubestar.catalogue import onboard_catalogue

    board = CubeStarBoard(
        cubestar_scene(path),
        onboard_catalogue(),
        seed=seed,
        engine=engine,
        baud=baud or CUBESTAR.baud,
        kernel=place[0],
        i2c_bus=place[1],
        layout=layout,
    )
    return Opened("CubeStar", board)


def _cubesense(
    path: Path | None,
    seed: int,
    engine: Engine,
    baud: int | None,
    place: Place,
    *,
    mcu_addressing: bool = False,
) -> Opened:
    from cubestack.emulator.boards.cubesense.board import CubeSenseBoard

    board = CubeSenseBoard(
        cubesense_scene(path),
        seed=seed,
        engine=engine,
        baud=baud or CUBESENSE.baud,
        kernel=place[0],
        i2c_bus=place[1],
        mcu_addressing=mcu_addressing,
    )
    return Opened("CubeSense", board)


def _aramis(path: Path | None, seed: int, engine: Engine, baud: int | None, place: Place) -> Opened:
    from cubestack.host.cli.aramis_session import aramis_board

    if engine != "auto":
        raise ValueError(f"aramis has no FPGA: leave --engine {engine} out")
    board = aramis_board(
        path, seed=seed, baud=baud or ARAMIS.baud, kernel=place[0], i2c_bus=place[1]
    )
    return Opened("AraMiS", board)


#: Devices that can be emulated, by the names of the command line.
DEVICES: dict[str, Callable[[Path | None, int, Engine, int | None, Place], Opened]] = {
    "cubestar": _cubestar,
    "cubesense": _cubesense,
    "aramis": _aramis,
}

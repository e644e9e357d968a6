"""An emulated AraMiS star tracker with a client on its serial line, in this process."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from cubestack.firmware_model.interface.aramis import INTERFACE
from cubestack.host.cli.terminal import progress
from cubestack.host.clients.aramis.client import Aramis
from cubestack.host.clients.node import NodeClient

if TYPE_CHECKING:
    from collections.abc import Iterator

    from cubestack.emulator.boards.aramis.board import AramisBoard
    from cubestack.emulator.bus.i2c import I2cBus
    from cubestack.emulator.camera.common.view import SkyView
    from cubestack.emulator.camera.mt9m001.noise import NoiseTerms
    from cubestack.emulator.scene.sky import Scene
    from cubestack.emulator.sim.virtual_time import Kernel
    from cubestack.firmware_model.aramis.catalogue.database import Database

__all__ = ["DEFAULT_FIELD_DEG", "AramisSession", "aramis_board", "aramis_catalogue", "open_aramis"]

DEFAULT_POINTING_DEG = (84.0, -1.0, 0.0)  # Orion's belt

DEFAULT_FIELD_DEG = 21.53463888888889
"""Of the published simulations; the lens that was expected to be built has 18."""


@lru_cache(maxsize=2)
def aramis_catalogue(field_deg: float = DEFAULT_FIELD_DEG) -> Database:
    """The onboard catalogue for a lens, from the user's cache or made now, which takes seconds.

    Shows its progress, so no other progress may be shown meanwhile.
    """
    from cubestack.emulator.boards.aramis.catalogue import CatalogueParameters, cached_database

    usual = CatalogueParameters()
    if abs(field_deg - usual.fov_deg) < 1e-3:
        return cached_database(usual, progress)
    return cached_database(replace(usual, fov_deg=field_deg), progress)


def aramis_board(
    path: Path | None,
    *,
    seed: int = 0,
    baud: int = INTERFACE.baud,
    kernel: Kernel | None = None,
    i2c_bus: I2cBus | None = None,
) -> AramisBoard:
    """Power up a star tracker that looks at the scene in ``path``, or at Orion."""
    from cubestack.emulator.boards.aramis.board import AramisBoard
    from cubestack.emulator.camera.common.scene_file import load_scene
    from cubestack.emulator.camera.mt9m001.lens import CONDITION
    from cubestack.emulator.scene.sky import SkyScene

    scene: Scene | SkyView
    if path is None:
        scene = SkyScene.pointing(*DEFAULT_POINTING_DEG)
    else:
        scene = load_scene(path, CONDITION)
    return AramisBoard(
        scene, aramis_catalogue(), seed=seed, baud=baud, kernel=kernel, i2c_bus=i2c_bus
    )


class AramisSession:
    """What a command needs to run a star tracker and to talk to it.

    Attributes:
        board: the emulated device.
        aramis: host's view, which sees only the bytes of the serial line.
    """

    def __init__(self, board: AramisBoard) -> None:
        """Plug a client into ``board``."""
        self.board = board
        self.aramis = Aramis(NodeClient(board.serial(), INTERFACE))


@contextmanager
def open_aramis(
    scene: Scene | SkyView,
    *,
    seed: int = 0,
    field_deg: float = DEFAULT_FIELD_DEG,
    noise: NoiseTerms | None = None,
) -> Iterator[AramisSession]:
    """Power up a star tracker that looks at ``scene`` and has the catalogue of ``field_deg``."""
    from cubestack.emulator.boards.aramis.board import AramisBoard

    board = AramisBoard(scene, aramis_catalogue(field_deg), seed=seed, noise=noise)
    try:
        yield AramisSession(board)
    finally:
        board.close()

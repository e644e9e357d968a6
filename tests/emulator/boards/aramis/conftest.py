from functools import lru_cache
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.aramis.board import AramisBoard
from cubestack.emulator.boards.aramis.catalogue import CatalogueParameters, build_database
from cubestack.emulator.scene.attitude import attitude_error_deg, quaternion_from_pointing
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.aramis.catalogue.hamming import CODED_BYTES
from cubestack.firmware_model.interface.aramis import INTERFACE, CatalogueState
from cubestack.host.clients.aramis.client import Aramis
from cubestack.host.clients.node import NodeClient

ORION = quaternion_from_pointing(84.0, -1.0, 20.0)


@lru_cache(maxsize=2)
def catalogue(stars_per_field: int = 5) -> Database:
    return build_database(CatalogueParameters(step_deg=10, stars_per_field=stars_per_field))


def scene(**changes: Any) -> SkyScene:
    return SkyScene(ORION, **changes)


class Desk:
    def __init__(
        self, sky: SkyScene | None = None, *, with_catalogue: bool = True, seed: int = 0
    ) -> None:
        stars = catalogue() if with_catalogue else None
        self.board = AramisBoard(sky or scene(), stars, seed=seed)
        self.client = NodeClient(self.board.serial(), INTERFACE)
        self.aramis = Aramis(self.client)

    @property
    def now_s(self) -> float:
        return self.board.kernel.now / PS_PER_S

    def command(self, name: str, **values: Any) -> None:
        self.client.command(name, **values)
        self.client.wait_processed(5)

    def flags(self) -> set[str]:
        return {name for name, up in self.client.telemetry("ErrorFlags").items() if up}

    def flip_flash(self, word: int, *bits: int) -> None:
        for bit in bits:
            place = 8 * CODED_BYTES * word + bit
            self.board.catalogue_flash[place // 8] ^= np.uint8(1 << place % 8)

    def error_deg(self) -> tuple[float, float]:
        found = self.aramis.attitude()
        return attitude_error_deg(found.quaternion, self.board.truth(found.frame))


@pytest.fixture
def desk() -> Desk:
    return Desk()


@pytest.fixture
def active(desk: Desk) -> Desk:
    assert desk.aramis.activate() is CatalogueState.GOOD
    return desk

import numpy as np
import pytest

from cubestack.firmware_model.cubesense.vision.distortion import (
    Projection,
    RadiusTable,
    byte_table,
    fine_table,
)
from cubestack.firmware_model.cubesense.vision.nadir import NadirConfig
from cubestack.firmware_model.interface.cubesense.switches import CubeSenseSwitches
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.pic18 import PIC18F45K20

from .harness import Harness
from .links_harness import Links


@pytest.fixture
def meter() -> Meter:
    return Meter(PIC18F45K20)


@pytest.fixture(scope="session")
def equidistant() -> RadiusTable:
    return fine_table(Meter(PIC18F45K20), Projection.EQUIDISTANT)


@pytest.fixture(scope="session")
def stereographic() -> RadiusTable:
    return fine_table(Meter(PIC18F45K20), Projection.STEREOGRAPHIC)


@pytest.fixture
def published(meter: Meter) -> NadirConfig:
    return NadirConfig(byte_table(meter), Projection.EQUIDISTANT, checked=False)


@pytest.fixture
def node() -> Links:
    node = Links()
    node.pictures[:] = np.random.default_rng(5).integers(0, 256, node.pictures.shape)
    return node


@pytest.fixture
def unit(profile: str) -> Harness:
    return Harness(CubeSenseSwitches.of(profile))

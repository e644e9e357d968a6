import re

import pytest

from cubestack.firmware_model.mcu.blackfin import BLACKFIN_BF533, CORE_HZ, blackfin_bf533
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter


def test_clock_and_memory_speed() -> None:
    assert BLACKFIN_BF533.clock_hz == CORE_HZ
    # 70 ns are 42 cycles of 600 MHz, and 21 of 300 MHz.
    assert BLACKFIN_BF533.operations["flash_read"].cycles == 42
    assert blackfin_bf533(clock_hz=300_000_000).operations["flash_read"].cycles == 21


def test_nothing_is_fitted_and_everything_is_explained() -> None:
    tags = {cost.provenance for cost in BLACKFIN_BF533.operations.values()}
    assert tags == {"published", "assumed"}
    assert all(cost.source for cost in BLACKFIN_BF533.operations.values())


def test_every_float_operation_of_the_other_star_tracker_is_there() -> None:
    floats = {name for name in CORTEX_M3.operations if re.match("f32|i32", name)}
    assert floats <= set(BLACKFIN_BF533.operations)


def test_reading_the_flash_once_takes_the_bus_time() -> None:
    meter = Meter(BLACKFIN_BF533)
    meter.charge(flash_read=1_000_000)
    assert BLACKFIN_BF533.seconds(meter.total) == pytest.approx(0.070)

"""CubeSense thesis, section 7.4: both times are predicted, as no cost is fitted to either."""

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.vision.distortion import Projection, RadiusTable, byte_table
from cubestack.firmware_model.cubesense.vision.edges import EdgeConfig
from cubestack.firmware_model.cubesense.vision.nadir import NadirConfig, find_nadir
from cubestack.firmware_model.cubesense.vision.sun_centroid import SunConfig, find_sun, window_bytes
from cubestack.firmware_model.interface.cubesense.codes import DetectResult
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE
from cubestack.firmware_model.mcu.costs import CostTable, Meter
from cubestack.firmware_model.mcu.pic18 import PIC18F45K20

from .scenery import SUN_BORESIGHT, earth, edges_in, sun, window

IMAGING_S = 0.048


def bright(pixels: int) -> NDArray[np.uint8]:
    data = np.zeros(window_bytes(), np.uint8)
    data[:4] = (100, 1, 100, 0)
    data[4 : 4 + pixels] = 255
    return data


def sun_seconds(table: CostTable, data: NDArray[np.uint8], config: SunConfig) -> float:
    meter = Meter(table)
    meter.charge(strobe_byte=len(data))
    assert find_sun(data, config, meter).detect is DetectResult.SUCCESS
    return table.seconds(meter.total)


def nadir_seconds(table: CostTable, config: NadirConfig, edges: EdgeConfig) -> float:
    times = []
    for alpha, beta in ((0, 0), (10, 0), (0, 10), (7, -9), (20, 5)):
        meter = Meter(table)
        meter.charge(scan_byte=FULL_SIZE.scan_clocks)
        found = edges_in(earth(alpha, beta), meter, edges)
        assert find_nadir(found, config, meter).detect is DetectResult.SUCCESS
        times.append(table.seconds(meter.total))
    return float(np.mean(times))


@pytest.fixture
def published_sun(meter: Meter) -> SunConfig:
    return SunConfig(byte_table(meter), printed=True)


@pytest.fixture
def published_nadir(meter: Meter) -> NadirConfig:
    return NadirConfig(byte_table(meter), Projection.EQUIDISTANT, checked=False)


def test_sun_time_depends_on_the_number_of_its_pixels(published_sun: SunConfig) -> None:
    times = [
        IMAGING_S + sun_seconds(PIC18F45K20, bright(pixels), published_sun)
        for pixels in (43, 69, 109)
    ]
    # The published 70.4 ms are those of a Sun of about 63 pixels.
    assert times == pytest.approx([0.0646, 0.0720, 0.0835], abs=2e-4)


def test_a_sun_of_7_px_has_the_pixels_of_the_fit(published_sun: SunConfig, meter: Meter) -> None:
    rng = np.random.default_rng(2)
    counts = [
        find_sun(
            window(sun(np.array(SUN_BORESIGHT) + rng.uniform(0, 1, 2), 7)), published_sun, meter
        ).pixels
        for _ in range(30)
    ]
    assert np.mean(counts) == pytest.approx(109, rel=0.05)


def test_the_nadir_time(published_nadir: NadirConfig) -> None:
    whole_pixels = EdgeConfig(sub_pixel=False)
    predicted = IMAGING_S + nadir_seconds(PIC18F45K20, published_nadir, whole_pixels)
    # Published are 245 ms.
    assert predicted == pytest.approx(0.2456, abs=0.002)


def test_ours_takes_longer(
    published_sun: SunConfig,
    published_nadir: NadirConfig,
    equidistant: RadiusTable,
    stereographic: RadiusTable,
) -> None:
    extra = nadir_seconds(
        PIC18F45K20, NadirConfig(stereographic), EdgeConfig(sharp=True)
    ) - nadir_seconds(PIC18F45K20, published_nadir, EdgeConfig(sub_pixel=False))
    assert 0.1 < extra < 0.2  # a second fit, of distances, and its uncertainty
    data = window(sun(np.array(SUN_BORESIGHT), 7))
    extra = sun_seconds(PIC18F45K20, data, SunConfig(equidistant)) - sun_seconds(
        PIC18F45K20, data, published_sun
    )
    assert 0 < extra < 0.006

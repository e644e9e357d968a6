"""What CubeSense's model charges for the routines that pic18.c has as compiled code."""

from collections.abc import Callable, Mapping

import numpy as np

from cubestack.firmware_model.cubesense.vision.circle import LeastSquaresCircle
from cubestack.firmware_model.cubesense.vision.distortion import byte_table
from cubestack.firmware_model.cubesense.vision.sun_centroid import SunConfig, find_sun, window_bytes
from cubestack.firmware_model.mcu.costs import CostTable, Meter

POINT = np.array([[100.0, -80.0]], np.float32)


def charged_cycles(costs: CostTable) -> Mapping[str, int]:
    """Cycles of each routine: of one point, one edge, one fit, one pixel."""
    return {name: charge(costs) for name, charge in _CHARGES.items()}


def _undistort(costs: CostTable) -> int:
    table, meter = byte_table(Meter(costs)), Meter(costs)
    table.correct(POINT, meter)
    meter.charge(f32_convert=2)  # the offsets from the boresight
    return meter.total


def _add_edge(costs: CostTable) -> int:
    meter = Meter(costs)
    LeastSquaresCircle(POINT, meter)
    meter.charge(f32_convert=2, f32_div=2)  # 1/100 px to px
    return meter.total


def _solve(costs: CostTable) -> int:
    meter = Meter(costs)
    equations = LeastSquaresCircle(np.eye(3, 2, dtype=np.float32), meter)
    before = meter.total
    equations.centre()
    return meter.total - before


def _add_pixel(costs: CostTable) -> int:
    config, totals = SunConfig(byte_table(Meter(costs)), printed=True), []
    for pixels in (40, 41):
        data = np.zeros(window_bytes(), np.uint8)
        data[:4] = (100, 1, 100, 0)
        data[4 : 4 + pixels] = 255
        meter = Meter(costs)
        find_sun(data, config, meter)
        totals.append(meter.total)
    return totals[1] - totals[0]


_CHARGES: Mapping[str, Callable[[CostTable], int]] = {
    "undistort": _undistort,
    "add_edge": _add_edge,
    "solve": _solve,
    "add_pixel": _add_pixel,
}

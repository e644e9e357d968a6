from collections import Counter

import numpy as np
import pytest

from cubestack.firmware_model.cubesense.vision.distortion import RadiusTable
from cubestack.firmware_model.cubesense.vision.edges import EdgeConfig, run_search
from cubestack.firmware_model.cubesense.vision.nadir import NadirConfig, find_nadir
from cubestack.firmware_model.cubesense.vision.sample_search import Between, around_samples
from cubestack.firmware_model.interface.cubesense.codes import DetectResult
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE
from cubestack.firmware_model.mcu.costs import Meter

from ..scenery import earth, edges_in, error_deg


@pytest.mark.parametrize("between", Between)
@pytest.mark.parametrize(("alpha", "beta"), [(0, 0), (12, -7), (-20, 20)])
def test_edges_of_rows(meter: Meter, between: Between, alpha: float, beta: float) -> None:
    picture = earth(alpha, beta, rng=np.random.default_rng(4))
    lines = edges_in(picture, meter)
    edges = run_search(
        around_samples(EdgeConfig(), meter, between), lambda at: int(picture[at[1], at[0]])
    )
    rows = set(range(15 * 32, 480 * 32, 64 * 32))

    def on_rows(points: list[list[int]]) -> list[tuple[int, int]]:
        return sorted((x, y) for x, y in points if y in rows)

    assert len(on_rows(edges.points.tolist())) > 8
    assert on_rows(edges.points.tolist()) == on_rows(lines.points.tolist())


@pytest.mark.parametrize("between", Between)
def test_accuracy_from_few_pixels(
    stereographic: RadiusTable, between: Between, meter: Meter
) -> None:
    rng = np.random.default_rng(5)
    reads: list[int] = []
    for _ in range(10):
        alpha, beta = rng.uniform(-20, 20, 2)
        picture = earth(alpha, beta, rng=rng)
        asked: Counter[tuple[int, int]] = Counter()

        def read(at: tuple[int, int], picture=picture, asked=asked) -> int:
            asked[at] += 1
            return int(picture[at[1], at[0]])

        edges = run_search(around_samples(EdgeConfig(), meter, between), read)
        result = find_nadir(edges, NadirConfig(stereographic), meter)
        assert result.detect is DetectResult.SUCCESS
        assert error_deg((result.alpha / 100, result.beta / 100), (alpha, beta)) < 0.1
        reads.append(asked.total())
    # 80 samples; then 6 pixels an edge at most, or 64.
    most = {Between.BINARY: 80 + 6 * 24, Between.SEQUENTIAL: 80 + 63 * 24}[between]
    assert min(reads) > 80
    assert max(reads) <= most


def test_the_searches_cost_less_in_the_order_expected(meter: Meter) -> None:
    picture = earth(5, 5)
    meter.charge(scan_byte=FULL_SIZE.scan_clocks)
    edges_in(picture, meter)
    cycles = [meter.take()]
    for between in (Between.SEQUENTIAL, Between.BINARY):

        def read(at: tuple[int, int]) -> int:
            meter.charge(address_byte=1)
            return int(picture[at[1], at[0]])

        run_search(around_samples(EdgeConfig(), meter, between), read)
        cycles.append(meter.take())
    assert cycles[0] > 1.5 * cycles[1] > 1.9 * cycles[2]

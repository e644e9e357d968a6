from collections import Counter
from itertools import pairwise, product

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.vision.distortion import RadiusTable
from cubestack.firmware_model.cubesense.vision.edges import (
    MAX_EDGES,
    EdgeConfig,
    NadirLines,
    run_search,
)
from cubestack.firmware_model.cubesense.vision.masks import Mask, masked
from cubestack.firmware_model.cubesense.vision.nadir import NadirConfig, find_nadir
from cubestack.firmware_model.cubesense.vision.sample_search import Between, around_samples
from cubestack.firmware_model.interface.cubesense.codes import DetectResult
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, ReadOut
from cubestack.firmware_model.mcu.costs import Meter
from tests.tiers import quick

from ..scenery import (
    COLUMNS,
    NADIR_BORESIGHT,
    ROWS,
    distort,
    earth,
    edges_in,
    error_deg,
    place,
    rough,
)

PRINTED = EdgeConfig(sub_pixel=False)
NO_RIM = EdgeConfig(rim_px=1000)


def literal(picture: NDArray[np.uint8], config: EdgeConfig) -> list[list[int]]:
    """Coordinates in 1/32 px by a search over the picture, with each step as it is described."""
    found, threshold = [], config.threshold
    lines = [(y, False) for y in range(15, ROWS, 64)] + [(x, True) for x in range(63, COLUMNS, 64)]
    for line, vertical in lines:
        values = [int(v) for v in (picture[:, line] if vertical else picture[line])]
        samples = [-1, *range(63, len(values), 64)]
        if samples[-1] != len(values) - 1:
            samples.append(len(values) - 1)
        for before, now in pairwise(samples):
            was = before >= 0 and values[before] >= threshold
            if was == (values[now] >= threshold):
                continue
            light, dark = (before, now) if was else (now, before)
            for _ in range(int(np.log2(now - before))):
                middle = (light + dark) // 2
                if values[middle] >= threshold:
                    light = middle
                else:
                    dark = middle
            outside = values[dark] if dark >= 0 else 0
            share = 32 * (values[light] - threshold) // (values[light] - outside)
            along = 32 * light + (dark - light) * share
            x, y = (32 * line, along) if vertical else (along, 32 * line)
            away = np.hypot(x / 32 - config.boresight[0], y / 32 - config.boresight[1])
            if away < config.rim_px:
                found.append([x, y])
    return found


SHARP = EdgeConfig(sharp=True)


def rows_of(first: int, values: NDArray[np.float64]) -> NDArray[np.uint8]:
    """A dark picture with the same values in all rows from a column on."""
    picture = np.full((ROWS, COLUMNS), 34, np.uint8)
    picture[:, first : first + len(values)] = values
    return picture


@pytest.mark.parametrize(("last", "ends"), [(330, 0), (353, 0), (354, 2), (450, 2)])
def test_small_lights_create_no_edges(meter: Meter, last: int, ends: int) -> None:
    edges = edges_in(rows_of(314, np.full(last - 313, 200.0)), meter, SHARP)
    assert np.count_nonzero((edges.points[:, 1] == 32 * 207) & (edges.sides[:, 0] != 0)) == ends


def test_thin_crescent_yields_edges_of_the_limb_only(meter: Meter) -> None:
    edges = edges_in(rows_of(314, np.linspace(66, 40, 38)), meter, SHARP)
    in_rows = edges.sides[:, 0]
    assert np.count_nonzero(in_rows == 1) > 3
    assert not np.any(in_rows == -1)


@pytest.mark.parametrize("seed", range(6))
def test_edge_search_agrees_with_the_literal_search_in_noisy_images(
    meter: Meter, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    picture = rough(rng)
    config = EdgeConfig(threshold=80, rim_px=float(rng.uniform(100, 230)))
    edges = edges_in(picture, meter, config)
    expected = literal(picture, config)
    assert len(expected) > 8
    assert edges.points.tolist() == expected[:MAX_EDGES]
    assert edges.full == (len(expected) > MAX_EDGES)


def test_buffer_requests_64_pixels_and_32_at_the_end_of_a_column(meter: Meter) -> None:
    lines = NadirLines(EdgeConfig(), meter)
    asked = []
    while lines.wanted:
        asked.append(lines.wanted)
        lines.filled()
    assert asked == [1, *[64] * 80, 1, *([64] * 7 + [32]) * 10]
    assert sum(asked) == 1 + 5120 + 1 + 4800


@pytest.mark.parametrize(("start", "end", "steps"), [(200, 300, 6 + 6), (0, 463, 6 + 5)])
def test_binary_edge_search_reads_the_expected_pixels(
    meter: Meter, start: int, end: int, steps: int
) -> None:
    picture = np.zeros((ROWS, COLUMNS), np.uint8)
    picture[start:end, 127] = 70
    edges = edges_in(picture, meter, NO_RIM)
    on_rows = edges.points[:, 1] % (64 * 32) == 15 * 32
    assert (edges.points[~on_rows] // 32).tolist() == [[127, start], [127, end - 1]]
    row_edges = int(on_rows.sum())
    assert meter.counts["array_byte"] == 2 * 160 + steps + 6 * row_edges


@pytest.mark.parametrize("first", [0, 1, 62, 63, 64, 65, 126, 127])
def test_edge_at_any_buffer_position_is_located_exactly(meter: Meter, first: int) -> None:
    picture = np.zeros((ROWS, COLUMNS), np.uint8)
    picture[15, first:320] = 70
    edges = edges_in(picture, meter, NO_RIM)
    on_the_row = [point // 32 for point in edges.points if point[1] == 15 * 32]
    assert [point[0] for point in on_the_row][:2] == [first, 319]


def test_sub_pixel_edges_are_at_the_threshold_crossing(meter: Meter) -> None:
    picture = np.zeros((ROWS, COLUMNS), np.uint8)
    picture[79, 300:400] = 100
    picture[79, [299, 400]] = 40  # 70 is half-way from 40 to 100
    edges = edges_in(picture, meter)
    assert edges.points.tolist()[:2] == [[32 * 300 - 16, 79 * 32], [32 * 399 + 16, 79 * 32]]
    assert edges.offsets()[0].tolist() == [299.5 - 371, 79 - 236]


def test_sub_pixel_edges_follow_the_limb(meter: Meter) -> None:
    # A limb's radius at 30 % of its contrast is a constant fifth of a pixel outside of it.
    rng = np.random.default_rng(1)
    spread: dict[bool, float] = {}
    for sub_pixel in (False, True):
        distance: list[float] = []
        for _ in range(8):
            picture = earth(0, 0, altitude_km=float(rng.uniform(500, 1500)))
            edges = edges_in(picture, meter, EdgeConfig(sub_pixel=sub_pixel))
            radii = np.hypot(*edges.offsets().T)
            distance += (radii - radii.mean()).tolist()
        spread[sub_pixel] = float(np.std(distance))
    assert spread[True] < 0.1 < 0.2 < spread[False]


def test_lens_rim_creates_no_edges_of_the_earth(meter: Meter) -> None:
    # The Earth fills one side of the field of view and ends at its rim.
    edges = edges_in(earth(75, 20), meter)
    assert edges.false > 3
    assert np.hypot(*edges.offsets().T).max() < 226
    outward = edges.offsets() @ np.array([75, 20]) / np.hypot(75, 20)
    assert outward.max() < distort(2.9 * 90)
    for config, expected in ((PRINTED, True), (EdgeConfig(), False)):
        offsets = edges_in(earth(75, 20), meter, config).offsets()
        assert bool((np.hypot(*offsets.T) > 225).any()) is expected


@pytest.mark.parametrize(
    ("tilt", "turn"), quick([(0, 0), *product((15, 30), range(0, 360, 30))], 7)
)
def test_a_full_earth_at_750_km_gives_18_to_24_edges(meter: Meter, tilt: int, turn: int) -> None:
    a, b = tilt * np.cos(np.radians(turn)), tilt * np.sin(np.radians(turn))
    assert 18 <= len(edges_in(earth(a, b), meter)) <= 24


def test_edges_in_a_mask_are_dropped(meter: Meter) -> None:
    x, y = place(0, 0, NADIR_BORESIGHT)
    mask = Mask(0, int(x), 0, ROWS - 1)
    everything = edges_in(earth(0, 0), meter).points
    kept = edges_in(earth(0, 0), meter, EdgeConfig(masks=(Mask(), mask)))
    assert kept.points.tolist() == [p for p in everything.tolist() if p[0] >= 32 * x + 32]
    assert kept.false == len(everything) - len(kept) > 0
    assert int(y) == 236


@pytest.mark.parametrize("seed", range(50))
def test_edge_search_equals_a_reference_on_small_frames(meter: Meter, seed: int) -> None:
    rng = np.random.default_rng(seed)
    small = ReadOut(columns=24, rows=20, scan_step=8, first_row=3, first_column=7, window=7)
    picture = rng.integers(0, 255, (20, 24)).astype(np.uint8)
    config = EdgeConfig(threshold=128, boresight=(12, 10), rim_px=100)
    for x, y in edges_in(np.where(picture < 128, 0, 128), meter, config, small).points.tolist():
        neighbours = []
        if y // 32 in small.scan_rows:
            neighbours += [(x // 32 + d, y // 32) for d in (-1, 1)]
        if x // 32 in small.scan_columns:
            neighbours += [(x // 32, y // 32 + d) for d in (-1, 1)]
        assert picture[y // 32, x // 32] >= 128
        inside = [(a, b) for a, b in neighbours if 0 <= a < 24 and 0 <= b < 20]
        assert len(inside) < len(neighbours) or any(picture[b, a] < 128 for a, b in inside)


@pytest.mark.parametrize("between", Between)
@pytest.mark.parametrize(("alpha", "beta"), [(0, 0), (12, -7), (-20, 20)])
def test_sample_search_finds_the_same_row_edges_as_the_line_search(
    meter: Meter, between: Between, alpha: float, beta: float
) -> None:
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
def test_sample_search_is_accurate_from_few_pixels(
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


def test_sample_searches_cost_less_than_the_full_scan(meter: Meter) -> None:
    picture = earth(5, 5)
    meter.charge(scan_byte=FULL_SIZE.scan_clocks)
    edges_in(picture, meter)
    cycles = [meter.take()]
    for between in (Between.SEQUENTIAL, Between.BINARY):

        def read(at: tuple[int, int]) -> int:
            meter.charge(address_byte=1, port_write=13, strobe_byte=1)
            return int(picture[at[1], at[0]])

        run_search(around_samples(EdgeConfig(), meter, between), read)
        cycles.append(meter.take())
    assert cycles[0] > 1.3 * cycles[1] > 1.3 * cycles[2]


def test_mask_area_includes_its_boundary_pixels(meter: Meter) -> None:
    x, y = np.meshgrid(np.arange(20), np.arange(20))
    inside = masked(x.ravel(), y.ravel(), [Mask(3, 5, 7, 8)], meter).reshape(20, 20)
    expected = np.zeros((20, 20), bool)
    expected[7:9, 3:6] = True
    assert (inside == expected).all()


def test_all_zero_mask_area_is_unused_and_costs_nothing(meter: Meter) -> None:
    origin = np.zeros(1, np.int64)
    assert not masked(origin, origin, [Mask()] * 5, meter).any()
    assert meter.counts["i16_add"] == 0


def test_masks_combine_as_a_union(meter: Meter) -> None:
    at = np.arange(10)
    inside = masked(at, at, [Mask(1, 2, 0, 9), Mask(), Mask(8, 9, 0, 9)], meter)
    assert np.flatnonzero(inside).tolist() == [1, 2, 8, 9]

"""The listings of appendices C.2 to C.6, written out line by line, beside the model of each."""

from collections import Counter
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from cubestack.firmware_model.cubesense.vision import nadir, sun_centroid
from cubestack.firmware_model.cubesense.vision.distortion import RadiusTable, byte_table
from cubestack.firmware_model.cubesense.vision.edges import MAX_EDGES, EdgeConfig
from cubestack.firmware_model.interface.cubesense.codes import DetectResult
from cubestack.firmware_model.interface.cubesense.fpga import READ_OUTS
from cubestack.firmware_model.mcu.costs import Meter
from tests.tiers import quick

from ..scenery import chequered, earth, edges_in, error_deg, rough, scan, sun, window

F = np.float32
THRESHOLD = 70


def binary_search(search: list[int], light: int, dark: int, runtime: int) -> int:
    for _ in range(runtime):
        temp = (light + dark) >> 1
        if search[temp] >= THRESHOLD:
            light = temp
        else:
            dark = temp
    return light


def edge_detect(
    clocks: Iterator[int], rim: tuple[int, int], last: int, added: int = 1
) -> list[list[int]]:
    """Edges of the bytes of a scan; ``last`` is the first of the last 32 rows of a column.

    The listing has 1 ``added`` to positions on a line, which is right for its own FPGA only.
    """
    found: list[list[int]] = []

    def examine(size: int, prev: int, place: Callable[[int], list[int]]) -> int:
        search = [next(clocks) for _ in range(size)]
        now, runtime = search[size - 1], {64: 6, 32: 5}[size]
        if (now >= THRESHOLD) == (prev >= THRESHOLD):
            return now
        bounds = (size - 1, 0) if now >= THRESHOLD else (0, size - 1)
        edge = place(binary_search(search, *bounds, runtime))
        if (edge[0] - rim[0]) ** 2 + (edge[1] - rim[1]) ** 2 < 226**2:
            found.append(edge)
        return now

    next(clocks)
    for y in range(1, 9):
        prev = 0
        for x in range(1, 11):
            prev = examine(64, prev, lambda at: [(x << 6) - 64 + added + at, (y << 6) + 15 - 64])  # noqa: B023
    next(clocks)
    for x in range(1, 11):
        prev = 0
        for y in range(1, 8):
            prev = examine(64, prev, lambda at: [(x << 6) - 1, (y << 6) - 64 + added + at])  # noqa: B023
        examine(32, prev, lambda at: [(x << 6) - 1, last + added + at])  # noqa: B023
    assert next(clocks, None) is None
    return found


def interpolation(xd: np.float32, yd: np.float32, lookup: list[int]) -> list[int]:
    rd = np.sqrt(xd * xd + yd * yd)
    rd0 = int(rd)
    ru = F(rd0) + F(lookup[rd0]) + (F(lookup[rd0 + 1]) - F(lookup[rd0])) * (rd - F(rd0))
    return [int(ru * xd / rd * F(100)), int(ru * yd / rd * F(100))]


def calc_nadir(edges: list[list[int]], lookup: list[int]) -> list[int]:
    matrix, right, two = np.zeros((3, 3), F), np.zeros(3, F), F(2)
    for edge_x, edge_y in edges:
        ru = interpolation(F(edge_x - 371), F(edge_y - 236), lookup)
        x, y = F(ru[0]) / F(100), F(ru[1]) / F(100)
        term = x * x + y * y
        rows = [[two * x * x, two * x * y, x], [two * y * x, two * y * y, y], [two * x, two * y, 1]]
        matrix += np.array(rows, F)
        right -= np.array([term * x, term * y, term])
    (a, b, c), (d, e, f), (g, h, i) = matrix
    det = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    inverse = [
        [e * i - f * h, -(b * i - c * h), b * f - c * e],
        [-(d * i - f * g), a * i - c * g, -(a * f - c * d)],
    ]
    return [
        int(-(j * right[0] + k * right[1] + m * right[2]) / det * F(100)) for j, k, m in inverse
    ]


def calc_sun(data: list[int], lookup: list[int]) -> list[int]:
    xd = yd = F(0)
    total = 0
    for at, pixel in enumerate(data[4:]):
        if pixel >= 225:
            xd, yd = xd + F(at % 15) * F(pixel), yd + F(at // 15) * F(pixel)
            total += pixel
    x = F(data[0] + 256 * data[1] - 369) + xd / F(total) - F(5)
    y = F(data[2] + 256 * data[3] - 250) + yd / F(total) - F(3)
    return interpolation(x, y, lookup)


@pytest.fixture
def lookup(meter: Meter) -> list[int]:
    return list(map(int, byte_table(meter).differences))


@pytest.mark.parametrize(
    ("listing", "rim", "last"), [(False, (371, 236), 448), (True, (367, 237), 224)]
)
@pytest.mark.parametrize("gateware", ["both-searches", "corrected"])
@pytest.mark.parametrize("seed", range(2))
def test_edge_search_matches_the_published_listing(
    meter: Meter, seed: int, gateware: str, listing: bool, rim: tuple[int, int], last: int
) -> None:
    read_out = READ_OUTS[gateware]
    rng = np.random.default_rng(seed)
    tilted = earth(*rng.uniform(-25, 25, 2), rng=rng)
    for picture in (rough(rng), tilted, earth(0, 29), chequered()):
        config = EdgeConfig(sub_pixel=False, listing=listing)
        edges = edges_in(picture, meter, config, read_out)
        expected = edge_detect(map(int, scan(picture, read_out)), rim, last, read_out.as_printed)
        assert len(expected) >= 8
        assert (edges.points // 32).tolist() == expected[:MAX_EDGES]


def test_as_printed_gateware_and_program_offsets_cancel(meter: Meter) -> None:
    """The 1 of the program and the start columns of the gateware cancel.

    Not as printed, where a bright line that ends with a sample, another one here, ends late.
    """
    config, picture = EdgeConfig(sub_pixel=True), earth(6, -11)
    places = {
        gateware: {tuple(point) for point in edges_in(picture, meter, config, read_out).points}
        for gateware, read_out in READ_OUTS.items()
    }
    assert places["both-searches"] == places["corrected"]
    assert len(places["both-searches"]) > 15


@pytest.mark.parametrize("seed", quick(range(12), 4))
def test_nadir_fit_equals_the_printed_listing(
    meter: Meter, published: nadir.NadirConfig, lookup: list[int], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    alpha, beta = rng.uniform(-35, 35, 2)
    edges = edges_in(earth(alpha, beta, rng=rng), meter, EdgeConfig(sub_pixel=False))
    found = nadir.find_nadir(edges, published, meter)
    assert [found.x, found.y] == calc_nadir((edges.points // 32).tolist(), lookup)
    assert (found.detect, found.dropped, found.radius_deg) == (DetectResult.SUCCESS, 0, 0)


@pytest.mark.parametrize("seed", range(12))
def test_sun_search_equals_the_printed_listing(meter: Meter, lookup: list[int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    centre, bloom = rng.uniform((229, 110), (509, 390)), float(rng.uniform(3, 9))
    data = window(sun(centre, bloom, rng, flat=bool(seed % 2)))
    config = sun_centroid.SunConfig(byte_table(meter), printed=True)
    found = sun_centroid.find_sun(data, config, meter)
    assert [found.x, found.y] == calc_sun([int(byte) for byte in data], lookup)


def test_nadir_fit_charges_the_operations_of_the_printed_listing(
    meter: Meter, published: nadir.NadirConfig
) -> None:
    edges = edges_in(earth(3, -8), meter, EdgeConfig(sub_pixel=False))
    n, before = len(edges), Counter(meter.counts)
    nadir.find_nadir(edges, published, meter)
    spent = Counter(meter.counts) - before
    assert {name: count for name, count in spent.items() if name.startswith("f32")} == {
        "f32_sqrt": n,
        "f32_compare": n,  # ours: the radius may be 0
        "f32_mul": n * (7 + 14) + 27 + 2,
        "f32_add": n * (5 + 13) + 15,
        "f32_div": n * (2 + 2) + 2 + 2,  # the last two are the angles'
        "f32_convert": n * (2 + 8 + 2) + 2 + 4,
    }


@pytest.mark.parametrize("first", [(100, 1, 200, 0), (139, 0, 247, 0)], ids=["stuck", "outside"])
@pytest.mark.parametrize(("printed", "detect"), [(False, "SUN_NOT_FOUND"), (True, "SUCCESS")])
def test_sun_search_skips_stuck_and_outside_pixels_unless_as_printed(
    meter: Meter, printed: bool, detect: str, first: tuple[int, ...]
) -> None:
    config = sun_centroid.SunConfig(byte_table(meter), printed=printed)
    data = np.zeros(sun_centroid.window_bytes(), np.uint8)
    data[:4], data[100] = first, 230
    assert sun_centroid.find_sun(data, config, meter).detect.name == detect
    data[100] = 224
    assert sun_centroid.find_sun(data, config, meter).detect is DetectResult.SUN_NOT_FOUND


@pytest.mark.parametrize("checked", [True, False])
def test_accepts_any_circle(
    meter: Meter, published: nadir.NadirConfig, stereographic: RadiusTable, checked: bool
) -> None:
    picture = earth(10, 5)
    picture[:, :371] = 34  # lit from the right: the terminator is a straight line
    for config in (nadir.NadirConfig(stereographic, checked=checked), published):
        found = nadir.find_nadir(edges_in(picture, meter), config, meter)
        assert found.detect is DetectResult.SUCCESS
        right = error_deg((found.alpha / 100, found.beta / 100), (10, 5)) < 0.3
        assert right is config.checked
        few = nadir.find_nadir(edges_in(earth(4, -10, 30_000), meter), config, meter)
        assert (few.detect is DetectResult.SUCCESS) is not config.checked
        assert few.edges == 4
        nothing = nadir.find_nadir(edges_in(picture * 0, meter), config, meter)
        assert nothing.detect is not DetectResult.SUCCESS

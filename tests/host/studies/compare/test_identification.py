import numpy as np
import pytest

from cubestack.emulator.boards.aramis.catalogue import onboard_database
from cubestack.firmware_model.aramis.field import CameraField
from cubestack.firmware_model.aramis.matching.identification import identify
from cubestack.firmware_model.aramis.matching.triangles import measure_triangle
from cubestack.firmware_model.aramis.solution import Profile, StarList
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.aramis import areas
from cubestack.host.studies.compare.database import Catalogue, angles
from cubestack.host.studies.compare.identification.agreement import agreeing
from cubestack.host.studies.compare.identification.grid import Grid
from cubestack.host.studies.compare.identification.methods import methods
from cubestack.host.studies.compare.identification.pyramid import order
from cubestack.host.studies.compare.identification.run import compare, judge
from cubestack.host.studies.compare.skies import CASES, EXACT, take_image
from cubestack.host.studies.compare.tracker import NONE

BY_NAME = {method.name: method for method in methods()}
SKIES = 12

#: Least share of right and largest share of wrong answers on exact skies, in %.
EXPECTED = {
    "triangle": (90, 0),
    "match group": (90, 0),
    "grid": (50, 0),
    "angle": (80, 10),
    "spherical triangle": (60, 25),
    "planar triangle": (60, 25),
    "geometric voting": (80, 10),
    "pyramid": (90, 0),
    "ours": (90, 0),
}

#: Of these, no answer may be wrong with ten false stars.
VERIFIED = ("triangle", "match group", "grid", "pyramid", "ours")

SLOW = {"spherical triangle"}
NAMES = [pytest.param(n, marks=pytest.mark.slow) if n in SLOW else n for n in EXPECTED]


def test_all_methods_have_an_expectation() -> None:
    assert {*EXPECTED} == {*BY_NAME}


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("device", ["cubestar", "aramis"])
def test_stars_of_an_exact_sky_are_named(
    device: str, name: str, request: pytest.FixtureRequest
) -> None:
    catalogue: Catalogue = request.getfixturevalue(device)
    method = BY_NAME[name].build(catalogue)
    (row,) = compare(catalogue.tracker, {name: method}, SKIES, 5, [EXACT])
    least_right, most_wrong = EXPECTED[name]
    assert row.figures["right"] >= least_right
    assert row.figures["wrong"] <= most_wrong
    assert row.figures["operations"] > 0
    assert row.figures["longest_ms"] >= row.figures["mean_ms"] > 0


@pytest.mark.parametrize("name", VERIFIED)
def test_verified_answers_are_not_wrong_with_ten_false_stars(
    name: str, cubestar: Catalogue
) -> None:
    method = BY_NAME[name].build(cubestar)
    (row,) = compare(cubestar.tracker, {name: method}, SKIES, 5, [CASES[3]])
    assert row.figures["wrong"] == 0


def test_rows_follow_from_the_seed(cubestar: Catalogue) -> None:
    method = {"pyramid": BY_NAME["pyramid"].build(cubestar)}
    one, same, other = (
        list(compare(cubestar.tracker, method, 3, seed, CASES[:2])) for seed in (5, 5, 6)
    )
    assert one == same
    assert one != other


def test_planar_triangles_are_the_published_firmware(aramis: Catalogue) -> None:
    method = areas.Areas(aramis, areas.PLANAR)
    field = CameraField()
    profile = Profile(sigma_rad=method.sigma, verify=False)
    for number in range(10):
        image = take_image(aramis.tracker, CASES[0], 5, number)
        stars = StarList(image.pixels, image.brightness)
        theirs = identify(stars, field, profile, onboard_database(), Meter(aramis.tracker.table))
        ours = method(image, Meter(aramis.tracker.table))
        assert ours.tolist() == theirs.stars.tolist()


def test_one_wrong_name_makes_an_answer_wrong(cubestar: Catalogue) -> None:
    tracker, method = cubestar.tracker, BY_NAME["pyramid"].build(cubestar)
    image = take_image(tracker, EXACT, 5, 0)
    names = method(image, Meter(tracker.table))
    assert judge(names, image, tracker, 0) == "right"
    named = np.flatnonzero(names != NONE)
    swapped = names.copy()
    swapped[named[:2]] = names[named[1::-1]]
    assert judge(swapped, image, tracker, 0) == "wrong"
    few = np.full_like(names, NONE)
    few[named[:2]] = names[named[:2]]
    assert judge(few, image, tracker, 0) == "refused"


def test_stars_that_contradict_most_others_leave(cubestar: Catalogue) -> None:
    vectors = cubestar.vectors
    stars = np.array([3, 7, 20, 33, 50])
    measured = angles(vectors[stars][:, None], vectors[stars][None])
    names = stars.copy()
    names[2] = 90
    meter = Meter(cubestar.tracker.table)
    assert agreeing(stars, measured, vectors, 1e-4, meter).tolist() == stars.tolist()
    assert agreeing(names, measured, vectors, 1e-4, meter).tolist() == [3, 7, NONE, 33, 50]


def test_pyramid_takes_every_triple_once() -> None:
    found = list(order(7))
    assert len(found) == len(set(found)) == 35
    assert all(one < two < three for one, two, three in found)


def test_grid_pattern_does_not_depend_on_roll(cubestar: Catalogue) -> None:
    grid = Grid(cubestar)
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    for star in (0, 100, 200):
        turned = grid._cells(cubestar.vectors @ turn, star)
        assert turned.tolist() == np.flatnonzero(grid.patterns[star]).tolist()


# --- spherical triangles --------------------------------------------------------------------------


def _equation_5_1(corners: np.ndarray) -> float:
    a, b, c = (angles(corners[i], corners[j]) for i, j in ((0, 1), (1, 2), (2, 0)))
    half = (a + b + c) / 2
    product = np.tan(half / 2)
    for side in (a, b, c):
        product *= np.tan((half - side) / 2)
    return float(4 * np.arctan(np.sqrt(product)))


def test_spherical_area_is_equation_5_1() -> None:
    octant, rng = np.eye(3), np.random.default_rng(4)
    random = rng.normal(size=(20, 3, 3))
    random /= np.linalg.norm(random, axis=2, keepdims=True)
    corners = np.concatenate([octant[None], random])
    found, _ = areas.spherical(corners)
    assert found[0] == pytest.approx(np.pi / 2, rel=1e-6)
    assert found == pytest.approx([_equation_5_1(one) for one in corners], rel=1e-5)


def test_spherical_triangles_are_planar_where_they_are_small() -> None:
    corners = np.array([[0, 0, 1], [0.01, 0, 1], [0.004, 0.012, 1]])
    corners /= np.linalg.norm(corners, axis=1, keepdims=True)
    (area,), (moment,) = areas.spherical(corners[None])
    flat = measure_triangle(corners.astype(np.float32), 1e-4, Meter(CORTEX_M3))
    assert flat is not None
    assert area == pytest.approx(float(flat.area), rel=1e-3)
    # Sixteen parts leave a sixteenth of the moment, that about their own middles.
    assert moment == pytest.approx(float(flat.moment) * 15 / 16, rel=1e-3)

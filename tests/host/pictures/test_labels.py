from itertools import combinations

import numpy as np
import pytest

import cubestack
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.scene.sky import SkyScene
from cubestack.host.pictures.labels import Box, Wanted, distance, place
from cubestack.host.studies.cubestar.demo import left_out_by
from tests.together import together

FRAME = Box(0, 0, 1024, 512)


def field(seed: int) -> tuple[list[Wanted], list[Box]]:
    """Random stars, some in clusters, some at the edge, and their marks."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 60))
    at = rng.uniform((0, 0), (1024, 512), (count, 2))
    if seed % 2:
        at = np.clip(at[0] + rng.normal(0, 40, (count, 2)), 0, (1024, 512))
    wanted = [
        Wanted(float(x), float(y), 10.0, float(width), 18.0)
        for (x, y), width in zip(at, rng.uniform(20, 130, count), strict=True)
    ]
    return wanted, [Box(w.x - 10, w.y - 10, w.x + 10, w.y + 10) for w in wanted]


@together("seed", range(60))
def test_labels_do_not_overlap_and_stay_inside(seed: int) -> None:
    wanted, marks = field(seed)
    boxes = place(wanted, FRAME, marks)
    assert len(boxes) == len(wanted)
    placed = [box for box in boxes if box is not None]
    assert not any(one.overlaps(other) for one, other in combinations(placed, 2))
    assert not any(box.overlaps(mark) for box in placed for mark in marks)
    assert all(box.within(FRAME) for box in placed)
    for box, label in zip(boxes, wanted, strict=True):
        if box is not None:
            assert box.right - box.left == pytest.approx(label.width)
            near = max(box.left - label.x, label.x - box.right, box.top - label.y)
            assert near < 60  # beside its own mark


def test_labels_of_distant_stars_are_at_the_right() -> None:
    wanted = [Wanted(200.0 * i + 50, 100, 10, 80, 18) for i in range(4)]
    boxes = place(wanted, FRAME)
    assert all(
        box is not None and box.left > label.x for box, label in zip(boxes, wanted, strict=True)
    )


def test_label_is_nearest_to_its_own_mark() -> None:
    pair = [Wanted(100, 100, 10, 70, 18), Wanted(124, 104, 10, 70, 18)]
    marks = [Box(w.x - 10, w.y - 10, w.x + 10, w.y + 10) for w in pair]
    beside = Box(0, 85, 88, 115)  # so that the first free place is right above the other mark
    for number, box in enumerate(place(pair, FRAME, [*marks, beside])):
        assert box is not None
        distances = [distance(box, label) for label in pair]
        assert distances[number] == min(distances)


def test_labels_without_room_are_omitted() -> None:
    crowded = [Wanted(50, 50, 10, 80, 18)] * 40
    boxes = place(crowded, FRAME)
    assert boxes[0] is not None
    assert None in boxes


@pytest.mark.parametrize("beside", [(10, 0), (-10, 0), (0, 10), (0, -10)])
def test_touching_boxes_do_not_overlap(beside: tuple[int, int]) -> None:
    across, down = beside
    assert not Box(0, 0, 10, 10).overlaps(Box(across, down, across + 10, down + 10))
    across, down = 0.9 * across, 0.9 * down
    assert Box(0, 0, 10, 10).overlaps(Box(across, down, across + 10, down + 10))


@pytest.mark.parametrize(
    ("x", "y", "away"),
    [
        *((25, 25, 0), (10, 20, 0), (40, 30, 0), (9, 25, 1), (41, 25, 1), (25, 19, 1)),
        *((25, 31, 1), (7, 16, 5), (43, 34, 5), (7, 34, 5), (43, 16, 5), (40.5, 25, 0.5)),
    ],
)
def test_distance_is_measured_to_the_nearest_edge(x: float, y: float, away: float) -> None:
    found = distance(Box(10, 20, 40, 30), Wanted(x, y, 1.0, 30.0, 10.0))
    assert found == pytest.approx(away)


pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


@pytest.mark.parametrize(
    ("profile", "told"),
    [
        ("published", "all after star 5, where the search stops"),
        ("extended", "all but the 10 brightest"),
    ],
)
def test_caption_names_a_reached_limit(profile: str, told: str) -> None:
    with cubestack.open_device("cubestar", SkyScene.pointing(84, -1, 20), profile=profile) as one:
        values = {"GridSize": 5, "MaxStars": 5, "MaxInvalidStars": 50, "MaxNoise": 255}
        one.client.configure({"setDetectionVariables": values})
        one.client.capture_and_process()
        assert left_out_by(one.client)[-1] == told


def test_caption_without_a_reached_limit() -> None:
    scene = SkyScene(SkyScene.pointing(84, -1, 20).quaternion, mag_limit=2.0)
    with cubestack.open_device("cubestar", scene, profile="extended") as one:
        one.client.capture_and_process()
        small, large = left_out_by(one.client)
    assert small.endswith(" spots too small")
    assert large.endswith(" too large")

import pytest

import cubestack
from cubestack.emulator.native.compiler import find_compiler

from .reference_pictures import compare

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


def test_telemetry_of_pictures_matches_in_every_mode() -> None:
    found = list(compare(3, 16, "reference"))
    assert [one.differences for one in found] == [[]] * 3
    assert {one.mode for one in found} == {"lost", "assisted", "as it stands"}
    assert any(one.solved for one in found)
    assert all(one.stars > 3 for one in found)


def test_measured_skies_give_the_same_quaternions() -> None:
    options = {"frames": 3, "seed": 7, "no_noise": True, "threshold": 16}
    both = [
        [
            (one.centroids, one.matched, one.quaternion)
            for one in cubestack.measure("cubestar", **options, **board)
        ]
        for board in ({}, {"firmware": "reference"})
    ]
    assert both[0] == both[1]
    assert any(quaternion is not None for _, _, quaternion in both[0])

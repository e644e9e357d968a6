"""What a star tracker left out, and why, as captions tell it."""

import pytest

import cubestack
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.scene.sky import SkyScene
from cubestack.host.studies.cubestar.demo import left_out_by

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


@pytest.mark.parametrize(
    ("profile", "told"),
    [
        ("published", "all after star 5, where the search stops"),
        ("extended", "all but the 10 brightest"),
    ],
)
def test_the_limit_of_the_list_is_told_when_it_is_reached(profile: str, told: str) -> None:
    with cubestack.open_device("cubestar", SkyScene.pointing(84, -1, 20), profile=profile) as one:
        values = {"GridSize": 5, "MaxStars": 5, "MaxInvalidStars": 50, "MaxNoise": 255}
        one.client.configure({"setDetectionVariables": values})
        one.client.capture_and_process()
        assert left_out_by(one.client)[-1] == told


def test_no_limit_is_told_where_none_is_reached() -> None:
    scene = SkyScene(SkyScene.pointing(84, -1, 20).quaternion, mag_limit=2.0)
    with cubestack.open_device("cubestar", scene, profile="extended") as one:
        one.client.capture_and_process()
        small, large = left_out_by(one.client)
    assert small.endswith(" spots too small")
    assert large.endswith(" too large")

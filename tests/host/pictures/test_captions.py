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

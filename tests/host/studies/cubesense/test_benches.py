"""Trials on the benches: angles of the stage, and causes of scatter."""

from typing import Any

import numpy as np
import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.host.devices.registry import device
from cubestack.host.experiments.opener import Opener
from cubestack.host.studies.cubesense import benches
from cubestack.host.studies.cubesense.ball import BallOptions

compiled = pytest.mark.skipif(find_compiler() is None, reason="needs the compiled FPGA")


def test_stage_goes_from_first_to_last_angle() -> None:
    assert BallOptions(first=40, last=60, step=10).angles == [40, 50, 60]
    assert BallOptions(first=40, last=40).angles == [40]
    with pytest.raises(ValueError, match="--last must be at least --first, not 30 < 40"):
        BallOptions(first=40)


def test_lamp_swings_three_times_in_an_image_and_alike_along_rows() -> None:
    field = benches.LampSwing(depth=0.6, seed=3).response((480, 640))
    assert field is not None
    assert np.ptp(field, axis=1).max() == 0
    column = field[:, 0] - 1
    assert np.abs(column).max() == pytest.approx(0.6, abs=0.01)
    assert np.count_nonzero(np.diff(np.sign(column))) in (6, 7)  # 3.05 swings of 10 ms
    other = benches.LampSwing(depth=0.6, seed=4).response((480, 640))
    assert not np.array_equal(field, other)


@pytest.mark.slow
@compiled
def test_ball_partly_out_of_the_field_is_worse_as_published_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(benches, "PARTIAL_DEG", (30, 60))
    found: dict[str, Any] = {}
    for profile in ("published", "extended"):
        opened: Any = Opener(device("cubesense"), board={"profile": profile})
        found[profile] = benches.partial_earth(opened, 2)
    assert found["published"]["offset_60"] > 10 * found["published"]["offset_30"]
    assert found["extended"]["offset_60"] < 0.1


@pytest.mark.slow
@compiled
def test_a_camera_that_shakes_scatters_more(monkeypatch: pytest.MonkeyPatch) -> None:
    kept = {name: benches.CAUSES[name] for name in ("shake25", "shake75")}
    monkeypatch.setattr(benches, "CAUSES", kept)
    monkeypatch.setattr(benches, "BALL_DEG", ((0.0, 0.0),))
    monkeypatch.setattr(benches, "SUN_DEG", (40.0,))
    opened: Any = Opener(device("cubesense"), board={"profile": "extended"})
    found = benches.scatter(opened, 4)
    assert found["shake75_nadir"] > found["shake25_nadir"] > 0.01
    assert found["shake75_sun"] > 0.01

import json
from pathlib import Path

import pytest

from cubestack.host.cli.main import main
from tests.system.conftest import Measure

GOAL_DEG = 200 / 3600
"""AraMiS thesis, section 2.1: hundreds of seconds of arc."""

EXTENDED = ("--profile", "extended")


@pytest.mark.parametrize(
    "options",
    [
        ("--frames", 8, "--seed", 21, "--false-stars", 5),
        ("--frames", 3, "--seed", 27, "--field", 18),
    ],
    ids=["among false stars", "the likely lens"],
)
def test_aramis_solves_lost_in_space_frames(measure: Measure, options: tuple[object, ...]) -> None:
    for frame in measure(*options, *EXTENDED):
        assert (frame["right"], frame["reason"], frame["wrong"]) == (True, "confirmed", 0)
        assert frame["error_cross_deg"] < GOAL_DEG


def test_filtered_aided_mode_gives_no_wrong_attitude(measure: Measure) -> None:
    near = ("--mode", "assisted", "--hint-error", 2, "--set", "aided=filtered")
    frames = measure("--frames", 8, "--seed", 22, *near, "--profile", "published")
    assert sum(frame["right"] for frame in frames) >= 6
    for frame in frames:
        assert frame["right"] == frame["solved"]
        if frame["solved"]:
            assert frame["error_cross_deg"] < GOAL_DEG


def test_published_profile_accepts_a_unique_triangle_after_a_pivot(measure: Measure) -> None:
    near = ("--frames", 4, "--seed", 21, "--mode", "assisted", "--profile", "published")
    found = {(frame["reason"], frame["pivots"], frame["matched"]) for frame in measure(*near)}
    assert found == {("unique", 1, 3)}


@pytest.mark.slow
def test_fast_roll_is_solved_and_fast_slew_smears(measure: Measure) -> None:
    for frame in measure("--frames", 2, "--seed", 23, "--roll-rate", 10, *EXTENDED):
        assert frame["right"]
        assert frame["error_cross_deg"] < 0.1
    frames = measure("--frames", 4, "--seed", 24, "--rate", 10, *EXTENDED)
    assert not any(frame["solved"] for frame in frames)
    # A sky without bright stars leaves no streak that could tell.
    others = {"too_few_stars", "unconfirmed"}
    assert {"smear"} <= {frame["reason"] for frame in frames} <= {"smear"} | others


def test_upsets_in_flash_are_corrected(measure: Measure) -> None:
    for frame in measure("--frames", 3, "--seed", 25, "--bit-flips", 1e-6, *EXTENDED):
        assert (frame["right"], frame["lost"]) == (True, 0)
        assert 10 < frame["corrected"] <= frame["flips"]


UNIT = """
kind = "sky"
ra_deg = 0
dec_deg = 0
[optics]
focal_length_mm = 14.1
cx = 645.0
cy = 505.0
"""


@pytest.mark.slow
def test_calibrate_finds_the_lens_of_an_emulated_aramis(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    scene = tmp_path / "unit.toml"
    scene.write_text(UNIT, encoding="utf-8")
    arguments = ("--json", "--emulated", "5", "--scene", str(scene))
    assert main(["calibrate", "aramis", *arguments]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["camera"]["f_px"] == pytest.approx(14100 / 5.2, abs=0.5)
    for name, true in (("cx_px", 645), ("cy_px", 505)):
        assert abs(found["camera"][name] - true) < 4 * found["sigma"][name] < 8
    assert found["after_px"] < 0.15 < 1 < found["before_px"]
    assert found["lens_px"] < 0.1

from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cubestack.emulator.boards.aramis import catalogue
from cubestack.emulator.boards.aramis.catalogue import CatalogueParameters, build_database
from cubestack.emulator.camera.common.register_file import RegisterFile
from cubestack.emulator.camera.common.shutter import RollingShutter
from cubestack.emulator.camera.mt9m001.imager import Mt9m001Imager
from cubestack.emulator.camera.mt9m001.lens import CONDITION
from cubestack.emulator.camera.mt9m001.registers import read_settings
from cubestack.emulator.scene.attitude import attitude_error_deg, quaternion_from_pointing
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.interface.cameras.mt9m001 import REGISTERS
from cubestack.host.clients.aramis.client import Star
from cubestack.host.experiments.aramis.measure import (
    EXPERIMENT,
    FIELD_DEG,
    NOISE_TERMS,
    ROW_S,
    AramisOptions,
    AramisResult,
    _configure,
    _is_far,
)
from cubestack.host.experiments.measure import measure as measure_device

from ....conftest import Run


@pytest.fixture(scope="module")
def small() -> Database:
    return build_database(CatalogueParameters(step_deg=10, stars_per_field=5))


@pytest.fixture(autouse=True)
def _small_catalogue(monkeypatch: pytest.MonkeyPatch, small: Database) -> None:
    monkeypatch.setattr(catalogue, "onboard_database", lambda *_field, **_progress: small)


def measure(**options: Any) -> list[AramisResult]:
    return list(measure_device("aramis", **options))  # type: ignore[arg-type]


def test_random_skies_are_solved_lost_in_space() -> None:
    frames = measure(frames=3, profile="extended")
    for frame in frames:
        assert (frame.right, frame.wrong, frame.flips, frame.status) == (True, 0, 0, "")
        assert (frame.outcome, frame.reason, frame.mode) == ("conclusive", "confirmed", "lis")
        assert frame.error_cross_deg < 0.01
        assert len(frame.truth or ()) == len(frame.quaternion or ()) == 4
        assert frame.matched >= 3
        assert frame.phase_ms["total"] > 200
    assert frames[0].truth != frames[1].truth


def test_same_seed_repeats_the_result() -> None:
    first, again, other = (
        replace(measure(frames=1, seed=seed)[0], wall_ms=0.0) for seed in (4, 4, 5)
    )
    assert first == again
    assert first.truth != other.truth


def test_aramis_measure_supports_modes_noise_rates_and_settings() -> None:
    (aided,) = measure(mode="assisted", hint_error=4)
    assert (aided.right, aided.mode) == (True, "assisted")
    (ideal,), (quiet,) = measure(no_noise=True), measure(without=NOISE_TERMS)
    assert ideal.error_cross_deg == quiet.error_cross_deg
    (published,) = measure(profile="published", exposure=100, gain=8)
    assert published.reason not in ("confirmed", "unconfirmed")
    (turning,) = measure(roll_rate=10, exposure=100)
    assert turning.right


def test_coded_catalogue_survives_flips_of_ram_without_reading_the_flash() -> None:
    plain, coded = (
        list(measure(ram_flips=1e-7, frames=2, **more)) for more in ({}, {"set": "ram=coded"})
    )
    assert all(frame.flips > 5 and "RamError" in frame.status for frame in [*plain, *coded])
    check = max(frame.phase_ms["check"] for frame in coded)
    assert all(frame.phase_ms["check"] > 4 * check for frame in plain)


@pytest.mark.slow
def test_bit_flips_in_flash_are_counted() -> None:
    for frame in measure(bit_flips=3e-6, frames=2):
        assert 0 < frame.corrected <= frame.flips
        assert (frame.right, frame.lost) == (True, 0)
        assert frame.status in ("", "CatalogueCorrected")
    (damaged,) = measure(bit_flips=1e-2)
    assert (damaged.solved, damaged.right, damaged.quaternion) == (False, False, None)
    assert damaged.reason in ("catalogue_damaged", "no_catalogue")


def test_measure_accepts_a_scene_file_or_object(tmp_path: Path) -> None:
    path = tmp_path / "sky.toml"
    path.write_text('kind = "sky"\nra_deg = 84.0\ndec_deg = -1.0\n', encoding="utf-8")
    made = SkyScene.pointing(84.0, -1.0)
    frames = [*measure(scene=path, frames=2), *measure(scene=made)]
    assert [frame.truth for frame in frames] == [frames[0].truth] * 3
    assert all(frame.right for frame in frames)


def test_image_file_is_solved_without_truth(tmp_path: Path) -> None:
    scene = SkyScene.pointing(84.0, -1.0, 20.0)
    settings = read_settings(RegisterFile(REGISTERS))
    settings = replace(settings, exposure_rows=6299, gains=(15.0,) * 4)  # type: ignore[arg-type]
    shutter = RollingShutter(10**12, Fraction(31_750_000), 6299, 6299)
    sky = Mt9m001Imager().render(scene, CONDITION, shutter, settings)
    Image.fromarray(np.pad(sky, ((0, 20), (7, 0)))).save(tmp_path / "sky.png")
    (frame,) = measure(image=tmp_path / "sky.png", crop=(7, 0))
    assert (frame.solved, frame.right, frame.truth) == (True, None, None)
    assert attitude_error_deg(np.array(frame.quaternion), scene.quaternion)[0] < 0.01


def test_command_prints_a_table(run: Run) -> None:
    shown = run("measure", "aramis", "--frames", "2", "--profile", "extended").out
    assert all(text in shown for text in ("100.0 % right", "mean time", "confirmed"))


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"crop": (1, 2)}, "--crop belongs to --image"),
        ({"scene": "x.toml", "rate": 1}, "belong to the random sky"),
        ({"scene": "x.toml", "image": "x.png"}, "--scene and --image exclude each other"),
        ({"image": "x.png", "mode": "assisted"}, "x.png"),
        ({"false_mags": (6, 4.5)}, "the brightest first"),
    ],
)
def test_rejects_invalid_options(options: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        measure(**options)


@pytest.mark.parametrize(
    ("third", "turned_deg", "far"),
    [((25930,), 0, False), ((25930,), 20, False), ((25930,), 24, True), ((), 0, None)],
)
def test_triangle_outside_the_field_is_counted_as_wrong(
    third: tuple[int, ...], turned_deg: float, far: bool | None
) -> None:
    belt = [Star(0, 0.0, 0.0, 100.0, one) for one in (26311, 26727, *third)]
    truth = quaternion_from_pointing(84.05, -1.2 + turned_deg, 0.0)
    assert _is_far(belt, FIELD_DEG, truth) == far
    assert _is_far(belt, FIELD_DEG, None) is None


def test_summary_counts_far_triangles() -> None:
    (frame,) = found = measure(frames=1, profile="published")
    assert frame.far is False
    lines = list(EXPERIMENT.summarise([*found, replace(frame, far=True)], 1.0))
    assert lines[-1].endswith("more than a field away: 50.0 %")


def sent(**options: Any) -> list[tuple[str, dict[str, Any]]]:
    said = list[tuple[str, dict[str, Any]]]()
    client = SimpleNamespace(
        command=lambda name, **values: said.append((name, values)),
        wait_processed=lambda timeout_s: said.append(("wait", {"s": timeout_s})),
    )
    star_tracker: Any = SimpleNamespace(client=client)
    _configure(star_tracker, AramisOptions(**options))
    return said


def test_only_changed_settings_are_sent() -> None:
    (field, values), wait = sent()
    assert (field, values["FieldOfView"]) == ("SetField", pytest.approx(21.534639))
    assert wait[0] == "wait"
    assert [name for name, _ in sent(exposure=100, gain=3.5)] == [
        *("SetField", "SetExposure", "SetGain", "wait")
    ]
    assert sent(gain=3.5)[1] == ("SetGain", {"Gain": 3.5})


@pytest.mark.parametrize("exposure_ms", [0.001, 1.0, 20.0, 200.0])
def test_exposure_is_rounded_to_rows(exposure_ms: float) -> None:
    rows = sent(exposure=exposure_ms)[1][1]["Rows"]
    row_ms = 1000 * (1280 + 244) / 48e6
    assert abs(rows * ROW_S * 1000 - exposure_ms) <= max(ROW_S * 500, row_ms) * 1.001
    assert rows >= 1


FALSE_MAGS = AramisOptions.declared()["false_mags"]


@pytest.mark.parametrize("given", ["4.5,6", (4.5, 6), ("4.5", "6")])
def test_magnitudes_accept_text_and_pairs(given: object) -> None:
    assert FALSE_MAGS.take(given) == (4.5, 6.0)


@pytest.mark.parametrize("given", ["6,4.5", "4.5", "a,b", (6, 4.5)])
def test_magnitudes_reject_other_orders(given: object) -> None:
    with pytest.raises(ValueError, match=r"must (be|have) "):
        FALSE_MAGS.take(given)
    assert FALSE_MAGS.take("5,5") == (5.0, 5.0)

"""Frames that show settings or durations: which field shows what."""

import math

import pytest

from cubestack.firmware_model.cubestar.reports.tables import SETTINGS_SHOWN, TIMES_SHOWN
from cubestack.firmware_model.cubestar.settings import SETTING_COMMANDS
from cubestack.firmware_model.interface.cubestar import INTERFACE, IdMode

from ..harness import Harness
from ..sky import Sky


@pytest.mark.parametrize("frame", SETTINGS_SHOWN | TIMES_SHOWN)
def test_every_field_of_the_frame_shows_something(frame: str) -> None:
    table: dict[str, tuple[tuple[object, ...], ...]] = {**SETTINGS_SHOWN, **TIMES_SHOWN}
    shown = [row[0] for row in table[frame]]
    assert shown == [field.name for field in INTERFACE.telemetry(frame).fields]


@pytest.mark.parametrize("frame", SETTINGS_SHOWN)
def test_a_frame_shows_the_setting_that_its_field_is_named_after(unit: Harness, frame: str) -> None:
    values = unit.telemetry(frame)
    for field, command, parameter in SETTINGS_SHOWN[frame]:
        assert command in SETTING_COMMANDS
        declared = INTERFACE.telecommand(command).field(parameter)
        assert values[field] == pytest.approx(float(declared.reset or 0), rel=1e-6)
        shown = INTERFACE.telemetry(frame).field(field)
        assert (shown.type, shown.scale, shown.unit) == (
            declared.type,
            declared.scale,
            declared.unit,
        )


def test_a_frame_shows_the_times_of_its_steps(unit: Harness) -> None:
    processing = unit.program.commands._processing
    steps = sorted({step for rows in TIMES_SHOWN.values() for _, step, _ in rows})
    for number, step in enumerate(steps):
        processing.latest_ms[step] = 100.0 + number
        processing.longest_ms[step] = 200.0 + number
    for frame, rows in TIMES_SHOWN.items():
        values = unit.telemetry(frame)
        for field, step, is_longest in rows:
            assert field.startswith("Max") == is_longest
            assert values[field] == steps.index(step) + (200 if is_longest else 100)


def test_every_step_is_one_that_the_processing_measures(lit: Harness, sky: Sky) -> None:
    lit.command("CaptureAndProcess")
    lit.command("setIDMode", IdMode=IdMode.TRACKING)
    x, y, z = sky.attitude.inv().as_matrix()[:, 2]
    lit.command("setTrackingMode", RightAscension=math.atan2(y, x), Declination=math.asin(z))
    lit.command("CaptureAndProcess", "SelectBestStars")
    steps = {step for rows in TIMES_SHOWN.values() for _, step, _ in rows}
    assert steps <= lit.program.commands._processing.latest_ms.keys()

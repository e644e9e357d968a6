"""Frames that show settings or durations: which field shows what."""

import math

import pytest

from cubestack.firmware_model.cubestar.state import SETTING_COMMANDS
from cubestack.firmware_model.cubestar.telemetry import SETTINGS_SHOWN, TIMES_SHOWN
from cubestack.firmware_model.interface.cubestar import INTERFACE, IdMode

from .harness import Harness
from .sky import Sky


@pytest.mark.parametrize("frame", SETTINGS_SHOWN | TIMES_SHOWN)
def test_every_field_of_the_frame_shows_something(frame: str) -> None:
    shown = {**SETTINGS_SHOWN, **TIMES_SHOWN}[frame]
    assert list(shown) == [field.name for field in INTERFACE.telemetry(frame).fields]


@pytest.mark.parametrize("frame", SETTINGS_SHOWN)
def test_a_frame_shows_the_setting_that_its_field_is_named_after(unit: Harness, frame: str) -> None:
    values = unit.telemetry(frame)
    for field, (command, parameter) in SETTINGS_SHOWN[frame].items():
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
    processing = unit.program.commands.processing
    steps = sorted({step for shown in TIMES_SHOWN.values() for step in shown.values()})
    for number, step in enumerate(steps):
        processing.latest_ms[step] = 100.0 + number
        processing.longest_ms[step] = 200.0 + number
    for frame, shown in TIMES_SHOWN.items():
        values = unit.telemetry(frame)
        for field, step in shown.items():
            assert values[field] == steps.index(step) + (200 if "Max" in field else 100)


def test_every_step_is_one_that_the_processing_measures(lit: Harness, sky: Sky) -> None:
    lit.command("CaptureAndProcess")
    lit.command("setIDMode", IdMode=IdMode.TRACKING)
    x, y, z = sky.attitude.inv().as_matrix()[:, 2]
    lit.command("setTrackingMode", RightAscension=math.atan2(y, x), Declination=math.asin(z))
    lit.command("CaptureAndProcess", "SelectBestStars")
    steps = {step for shown in TIMES_SHOWN.values() for step in shown.values()}
    assert steps <= lit.program.commands.processing.latest_ms.keys()

from typing import Any

import pytest

from cubestack.firmware_model.interface.cubestar import TaskStatus

from .bench import Star


def status(star: Star) -> TaskStatus:
    return TaskStatus(star.telemetry("TaskStatus")["taskStatus"])


def after(star: Star, *names: str, **parameters: Any) -> TaskStatus:
    """The task status after the telecommands; the last one has ``parameters``."""
    for name in names:
        star.client.command(name, **(parameters if name == names[-1] else {}))
        star.client.wait_processed(10.0)
    return status(star)


@pytest.mark.fault("camera-dead")
def test_task_states_of_a_dead_camera(star: Star) -> None:
    star.inject("camera-dead")
    assert after(star, "TogglePowerSW", "TogglePowerSW") is TaskStatus.CAMERA_FAILED
    assert after(star, "Exposure", exposure=100) is TaskStatus.EXPOSURE_FAILED
    assert after(star, "CaptureImage") is TaskStatus.CAPTURE_FAILED
    assert star.flags() == {"ISSetupError"}
    star.faults.clear()
    assert after(star, "Exposure", exposure=100) is TaskStatus.EXPOSURE_SET
    assert after(star, "TogglePowerSW", "TogglePowerSW") is TaskStatus.CAMERA_INITIALISED


@pytest.mark.parametrize(
    ("name", "parameters", "failed"),
    [
        ("UploadImage", {}, TaskStatus.RECEIVING_FAILED),
        ("CaptureTestPatern", {"TestPaternType": 0}, TaskStatus.PATTERN_FAILED),
    ],
)
@pytest.mark.fault("latch-up")
def test_memory_switched_off_during_a_write_fails(
    star: Star, name: str, parameters: dict[str, Any], failed: TaskStatus
) -> None:
    star.client.pause(0.05)
    star.inject("latch-up", target="memory", after_s=0.02)
    assert after(star, name, **parameters) is failed
    assert star.flags() == {"OverCurrent"}
    assert after(star, "DetectStars") is TaskStatus.DETECTION_FAILED


@pytest.mark.fault("latch-up")
def test_memory_switched_off_during_its_test_fails(star: Star) -> None:
    star.client.pause(0.05)
    star.inject("latch-up", target="memory", after_s=0.05)
    star.client.command("TestSRAM")
    star.client.pause(0.03)
    assert status(star) is TaskStatus.TESTING_SRAM
    star.client.wait_processed(10.0)
    assert status(star) is TaskStatus.SRAM_TESTED
    assert star.telemetry("SRAMTestResults")["TestResult"] == 2

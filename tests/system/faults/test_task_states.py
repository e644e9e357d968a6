"""CubeStar's task states that only a fault brings about, as a host sees them."""

from typing import Any

import pytest

from cubestack.firmware_model.interface.cubestar import TaskStatus

from .bench import Star


def status(star: Star) -> TaskStatus:
    return TaskStatus(star.telemetry("TaskStatus")["taskStatus"])


def after(star: Star, *names: str, **parameters: Any) -> TaskStatus:
    """Where the node is when the telecommands, the last one with ``parameters``, are done."""
    for name in names:
        star.client.command(name, **(parameters if name == names[-1] else {}))
        star.client.wait_processed(10.0)
    return status(star)


@pytest.mark.fault("camera-dead")
def test_a_dead_camera_fails_to_start_to_be_exposed_and_to_capture(star: Star) -> None:
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
def test_a_memory_that_is_cut_while_it_is_written_fails(
    star: Star, name: str, parameters: dict[str, Any], failed: TaskStatus
) -> None:
    star.client.pause(0.05)
    star.inject("latch-up", target="memory", after_s=0.02)
    assert after(star, name, **parameters) is failed
    assert star.flags() == {"OverCurrent"}
    assert after(star, "DetectStars") is TaskStatus.DETECTION_FAILED


@pytest.mark.fault("latch-up")
def test_a_memory_that_is_cut_while_it_is_tested_does_not_pass(star: Star) -> None:
    star.client.pause(0.05)
    star.inject("latch-up", target="memory", after_s=0.05)
    star.client.command("TestSRAM")
    star.client.pause(0.03)
    assert status(star) is TaskStatus.TESTING_SRAM
    star.client.wait_processed(10.0)
    assert status(star) is TaskStatus.SRAM_TESTED
    assert star.telemetry("SRAMTestResults")["TestResult"] == 2

from functools import partial
from typing import Any

import pytest

from cubestack.firmware_model.cubestar.commands import WATCHDOG_US
from cubestack.firmware_model.interface.cubestar import ResetCause, TaskStatus

from .bench import GOOD, READING_S, STORING_S, Star

IN_BOOT_S = 0.001

#: Faults, and the telecommand before them, by the cause that telemetry shows.
CAUSES: dict[ResetCause, tuple[str | None, tuple[str, ...]]] = {
    ResetCause.POWER_ON: (None, ()),
    ResetCause.BROWN_OUT_UNREGULATED: (None, ("brown-out",)),
    ResetCause.BROWN_OUT_REGULATED: (None, ("brown-out-regulated",)),
    ResetCause.EXTERNAL_OR_WATCHDOG: ("TestWDG", ("reset-pin",)),
    ResetCause.EXTERNAL_PIN: (None, ("reset-pin",)),
    ResetCause.WATCHDOG: (None, ("hang",)),
    ResetCause.LOCKUP_OR_SYSTEM_REQUEST: ("MCUReset", ("lock-up",)),
    ResetCause.LOCKUP: (None, ("lock-up",)),
    ResetCause.SYSTEM_REQUEST: ("MCUReset", ()),
    ResetCause.UNDETERMINED: ("TestWDG", ("lock-up",)),
}


def node(star: Star) -> dict[str, Any]:
    return star.telemetry("ExtendedIdentification")


def wait_for_resets(star: Star, count: int) -> None:
    until_s = star.now_s + 3
    while star.board.processor.resets < count and star.now_s < until_s:
        star.client.pause(IN_BOOT_S / 2)


def test_reset_causes_have_the_published_numbers() -> None:
    assert list(CAUSES) == list(ResetCause) == list(range(1, 11))


@pytest.mark.parametrize("cause", CAUSES, ids=lambda cause: cause.name)
def test_each_fault_reports_its_reset_cause(star: Star, cause: ResetCause) -> None:
    telecommand, faults = CAUSES[cause]
    star.client.pause(0.05)  # else the power-on would hide the rest
    if telecommand:
        star.client.command(telecommand)
        wait_for_resets(star, 1)
    for fault in faults:
        star.inject("processor-reset", target=fault)
    star.client.pause(0.01 + WATCHDOG_US / 1e6 * ("hang" in faults))
    shown = node(star)
    assert ResetCause(shown["ResetCause"]) is cause
    dogs = "hang" in faults or telecommand == "TestWDG"
    assert shown["WDGResetCount"] == int(dogs)
    assert star.measure() == "CALCULATED"


@pytest.mark.fault("processor-reset")
def test_hanging_program_answers_until_the_watchdog_reset(star: Star) -> None:
    star.client.pause(0.1)
    star.inject("processor-reset", target="hang")
    star.client.command("Exposure", exposure=7)  # is queued, and lost
    star.client.pause(1.5)
    assert not star.telemetry("TcmdProcessed")["Processed"]
    assert star.telemetry("Exposure")["exposure"] == 0
    star.client.pause(1.0)
    assert star.telemetry("TcmdProcessed")["Processed"]
    assert star.said() == ["resets the processor"]


@pytest.mark.parametrize("at_s", [STORING_S, READING_S])
@pytest.mark.parametrize("target", ["brown-out", "lock-up"])
@pytest.mark.fault("processor-reset")
def test_reset_during_a_capture_loses_the_image(star: Star, target: str, at_s: float) -> None:
    star.faults.inject("processor-reset", target=target, at_s=at_s)
    star.client.command("CaptureImage")
    star.client.wait_processed(5.0)
    star.client.pause(0.01)
    assert star.telemetry("TaskStatus")["taskStatus"] == 1
    assert star.telemetry("PerformanceParameters")["ImageCaptureSuccess"] is False
    assert star.board._pins == {"ENABLE": 0, "RNW": 0, "BANK": 0}
    assert star.capture() == GOOD


@pytest.mark.fault("processor-reset")
def test_loop_continues_after_a_reset(star: Star) -> None:
    start = partial(star.telemetry, "LoopStatus")
    star.client.command("Trigger")
    star.client.pause(1.5)
    star.inject("processor-reset", target="reset-pin")
    star.client.pause(2.0)
    assert (start()["Running"], start()["Iterations"] >= 2) == (True, True)
    assert star.telemetry("AttitudeQuaternion")["Valid"]


def status(star: Star) -> TaskStatus:
    return TaskStatus(star.telemetry("TaskStatus")["taskStatus"])


def after(star: Star, *names: str, **parameters: Any) -> TaskStatus:
    """The task status after the telecommands; the last one has ``parameters``."""
    for name in names:
        star.client.command(name, **(parameters if name == names[-1] else {}))
        star.client.wait_processed(10.0)
    return status(star)


@pytest.mark.fault("camera-dead")
def test_dead_camera_is_shown_in_the_task_states(star: Star) -> None:
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

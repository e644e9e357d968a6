from collections.abc import Callable

import pytest

from cubestack.firmware_model.cubestar.link import TASKS
from cubestack.firmware_model.interface.cubestar import AckError, TaskStatus
from cubestack.firmware_model.mcu.requests import CameraTransfer, Pay, Request

from .harness import Harness
from .sky import Sky

Act = Callable[[Harness, Sky], object]

#: The states that are failures in the published list.
FAILED = {3, 6, 14, 16, 20, 22, 25, 28, 34, 36}


def sending(*names: str, before: tuple[str, ...] = (), **values: object) -> Act:
    """Send telecommands, the last one after those ``before``, with a sky in view."""

    def act(unit: Harness, sky: Sky) -> None:
        unit.picture = sky.picture
        unit.command(*before)
        unit.command(*names, **values)

    return act


def failing(*names: str, dead: bool = False, cut: bool = False, **values: object) -> Act:
    """The same with a camera that does not answer, or a memory that loses its supply during it."""

    def act(unit: Harness, _sky: Sky) -> None:
        unit.camera_refuses = lambda _data: dead
        unit.command(*names[:-1])
        if cut:
            unit.on_request = lambda request: latch_up_once(unit, request)
        unit.command(names[-1], **values)

    return act


def latch_up_once(unit: Harness, request: Request) -> None:
    if isinstance(request, Pay) and not unit.program.supply.cut:
        unit.on_request = lambda _request: None
        unit.program.supply.overcurrent("memory")


def refused(name: str, **values: object) -> Act:
    def act(unit: Harness, _sky: Sky) -> None:
        assert unit.send(name, **values) == AckError.BAD_PARAMETER

    return act


STEPS = ("CaptureImage", "DetectStars", "IDStars")
CAUSES: dict[tuple[int, ...], Act] = {
    (0, 1): lambda unit, _sky: unit.power_on(),
    (2, 4): sending("CaptureImage"),
    (3,): failing("TogglePowerSW", "TogglePowerSW", dead=True),
    (5, 7): sending("Exposure", exposure=9),
    (6,): failing("Exposure", dead=True, exposure=9),
    (8, 9): sending("WriteTo_IS_Register", Reg=1, DataL=2),
    (10, 11): sending("ReadFrom_IS_Register", Reg=1),
    (12,): sending("UploadImage"),
    (13,): lambda unit, _sky: (
        unit.command("UploadImage"),
        unit.command("UploadBlock", BlockNumber=1, Data=bytes(128)),
    ),
    (14,): failing("UploadImage", cut=True),
    (15, 17): sending("CaptureImage"),
    (16,): failing("CaptureImage", dead=True),
    (18, 19): sending("ImageBlockSet", BlockNumber=3),
    (20,): refused("ImageBlockSet", BlockSize=4),
    (21, 23): sending("DetectStars", before=("CaptureImage",)),
    (22,): sending("DetectStars"),  # no picture
    (24, 26): sending(*STEPS),
    (25,): sending("IDStars"),
    (27, 29): sending("EstimateAttitude", before=STEPS),
    (28,): sending("EstimateAttitude"),
    (30, 31): sending("TestSRAM"),
    (32, 33): sending("CaptureTestPatern", TestPaternType=1),
    (34,): failing("CaptureTestPatern", cut=True),
    (35, 37): sending("SelectBestStars", before=STEPS),
    (36,): sending("SelectBestStars"),
    (38, 39): sending("StreamDownImage", before=("CaptureImage",)),
}


def test_task_states_are_the_published_ones() -> None:
    assert [int(status) for status in TaskStatus] == list(range(40))
    assert {status for status in TaskStatus if status.name.endswith("FAILED")} == FAILED
    assert sorted(state for states in CAUSES for state in states) == list(range(40))


@pytest.mark.parametrize("status", TaskStatus, ids=lambda status: status.name)
def test_every_state_is_reached_by_its_cause(unit: Harness, sky: Sky, status: TaskStatus) -> None:
    (act,) = [act for states, act in CAUSES.items() if status in states]
    seen: list[int] = []
    perform = unit._perform

    def watched(request: Request) -> object:
        seen.append(unit.program.state.task_status)
        return perform(request)

    unit._perform = watched  # type: ignore[method-assign]
    act(unit, sky)
    unit.sent.clear()  # what was streamed
    last = unit.status()
    assert status in (*seen, last)
    if not status.name.split("_")[0].endswith("ING") and status not in (1, 2, 4):
        assert last is status  # whoever polls later finds it


def test_task_states_for_begun_and_ended_are_disjoint(unit: Harness) -> None:
    begun = {task.begun for task in TASKS.values()} - {TaskStatus.RECEIVING_IMAGE}
    ended = {task.done for task in TASKS.values()} | {task.failed for task in TASKS.values()}
    assert not begun & ended


def test_refused_test_pattern_fails_and_leaves_no_image(unit: Harness) -> None:
    refused("CaptureTestPatern", TestPaternType=3)(unit, None)  # type: ignore[arg-type]
    assert unit.status() is TaskStatus.PATTERN_FAILED
    assert unit.flags() == {"TestPatternConfigError"}
    unit.command("DetectStars")
    assert unit.flags() == {"TestPatternConfigError", "StatusError"}  # there is no picture


def test_upload_block_fails_without_an_upload_or_after_a_latch_up(unit: Harness) -> None:
    block = {"BlockNumber": 1, "Data": b"\7" * 128}
    unit.command("UploadBlock", **block)
    assert unit.status() is TaskStatus.RECEIVING_FAILED
    unit.command("UploadImage")
    unit.command("UploadBlock", **block)
    assert unit.status() is TaskStatus.IMAGE_RECEIVED
    unit.program.supply.overcurrent("memory")
    unit.run()
    unit.command("UploadBlock", **block)
    assert unit.status() is TaskStatus.RECEIVING_FAILED
    unit.command("ProcessImage")
    assert unit.status() is TaskStatus.DETECTION_FAILED


def test_exposure_telecommand_writes_the_sensor_immediately(unit: Harness) -> None:
    unit.command("Exposure", exposure=321)
    assert unit.camera_value("EXPOSURE") == 321
    unit.log.clear()
    unit.command("CaptureImage")
    transfers = [what for _, what in unit.log if isinstance(what, CameraTransfer)]
    assert len(transfers) == 2  # enable, disable

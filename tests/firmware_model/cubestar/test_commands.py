import pytest

from cubestack.firmware_model.cubestar.commands import STREAM_BACKLOG_BYTES
from cubestack.firmware_model.mcu.requests import Sleep

from .harness import FRAME_US, Harness


def test_telecommands_are_executed_in_order(unit: Harness) -> None:
    for exposure in (1, 2, 3, 4):
        unit.send("Exposure", exposure=exposure)
    unit.shown("Exposure", exposure=0)
    unit.run()
    unit.shown("Exposure", exposure=4)


def test_processed_says_when_the_last_telecommand_is_done(unit: Harness) -> None:
    unit.shown("TcmdProcessed", Processed=1)
    unit.send("CaptureImage")
    unit.send("Exposure", exposure=1)
    unit.shown("TcmdProcessed", Processed=0)
    unit.run(until_us=unit.now_us + FRAME_US)
    unit.shown("TcmdProcessed", Processed=0)
    unit.run()
    unit.shown("TcmdProcessed", Processed=1)


@pytest.mark.parametrize("name", ["Reset", "MCUReset"])
def test_a_telecommand_that_resets_is_not_processed_before_it(unit: Harness, name: str) -> None:
    seen: dict[int, set[int]] = {0: set(), 1: set()}
    unit.on_request = lambda _request: seen[len(unit.resets)].add(
        unit.telemetry("TcmdProcessed")["Processed"]
    )
    unit.command(name)
    assert seen == {0: {0}, 1: {1}}


@pytest.mark.parametrize("name", ["Reset", "MCUReset", "TestWDG"])
def test_a_reset_drops_the_telecommands_that_wait(unit: Harness, name: str) -> None:
    unit.send(name)
    unit.command("Exposure", exposure=9)
    unit.shown("Exposure", exposure=0)


def test_the_stream_waits_for_the_uart(unit: Harness) -> None:
    unit.command("UploadImage")
    unit.backlog = STREAM_BACKLOG_BYTES + 1
    start_us = unit.now_us
    unit.send("StreamDownImage")
    unit.run(until_us=start_us + 1_000_000)
    assert unit.received() == []
    unit.backlog = STREAM_BACKLOG_BYTES
    unit.run()
    assert len(unit.received()) == 4096


@pytest.mark.parametrize("name", ["TestWDG", "CaptureImage"])
def test_an_interrupt_does_not_cut_a_wait_short(unit: Harness, name: str) -> None:
    sleeps = []
    unit.on_request = lambda request: sleeps.append(request) if isinstance(request, Sleep) else None
    unit.send(name)
    unit.send("Exposure", exposure=1)  # wakes
    unit.run()
    assert not sleeps[0].wakeable


def test_streaming_pays_for_each_pixel(unit: Harness) -> None:
    """A turn of the loop and a bus cycle for each of 1024 x 512 pixels."""
    unit.command("UploadImage")
    before = unit.meter.counts.copy()
    unit.command("StreamDownImage")
    paid = unit.meter.counts - before
    assert paid["ebi_read"] == 1024 * 512
    assert 1024 * 512 <= paid["loop"] < 1.1 * 1024 * 512

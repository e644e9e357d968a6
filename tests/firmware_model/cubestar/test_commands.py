"""Every telecommand of the table, executed, and what they have in common."""

import pytest

from cubestack.firmware_model.cubestar.commands import STREAM_BACKLOG_BYTES
from cubestack.firmware_model.interface.cubestar import (
    INTERFACE,
    ResetCause,
)
from cubestack.firmware_model.mcu.requests import Sleep

from . import effects_node, effects_picture
from .bench import FRAME_US, Bench
from .effects import EFFECTS, shown
from .sky import Sky


@pytest.mark.parametrize("name", [message.name for message in INTERFACE.telecommands])
def test_every_telecommand_does_what_it_says(name: str, bench: Bench, sky: Sky) -> None:
    EFFECTS[name](bench, sky)


def test_every_telecommand_has_an_effect_and_no_other_does(bench: Bench) -> None:
    declared = {message.name for message in INTERFACE.telecommands}
    assert bench.program.commands.handled == declared
    assert EFFECTS.keys() == declared
    shown_by = {effect.__module__ for effect in EFFECTS.values()}
    assert shown_by == {effects_node.__name__, effects_picture.__name__}


def test_telecommands_are_executed_in_order(bench: Bench) -> None:
    for exposure in (1, 2, 3, 4):
        bench.send("Exposure", exposure=exposure)
    shown(bench, "Exposure", exposure=0)
    bench.run()
    shown(bench, "Exposure", exposure=4)


def test_processed_says_when_the_last_telecommand_is_done(bench: Bench) -> None:
    shown(bench, "TcmdProcessed", Processed=1)
    bench.send("CaptureImage")
    bench.send("Exposure", exposure=1)
    shown(bench, "TcmdProcessed", Processed=0)
    bench.run(until_us=bench.now_us + FRAME_US)
    shown(bench, "TcmdProcessed", Processed=0)
    bench.run()
    shown(bench, "TcmdProcessed", Processed=1)


@pytest.mark.parametrize("name", ["Reset", "MCUReset"])
def test_a_telecommand_that_resets_is_not_processed_before_the_reset(
    bench: Bench, name: str
) -> None:
    seen: dict[int, set[int]] = {0: set(), 1: set()}
    bench.on_request = lambda _request: seen[len(bench.resets)].add(
        bench.telemetry("TcmdProcessed")["Processed"]
    )
    bench.command(name)
    assert seen == {0: {0}, 1: {1}}


@pytest.mark.parametrize("name", ["Reset", "MCUReset", "TestWDG"])
def test_a_reset_drops_the_telecommands_that_wait(bench: Bench, name: str) -> None:
    bench.send(name)
    bench.send("Exposure", exposure=9)
    bench.run()
    shown(bench, "Exposure", exposure=0)


def test_the_stream_waits_for_the_uart(bench: Bench) -> None:
    bench.command("UploadImage")
    bench.backlog = STREAM_BACKLOG_BYTES + 1
    start_us = bench.now_us
    bench.send("StreamDownImage")
    bench.run(until_us=start_us + 1_000_000)
    assert bench.received() == []
    bench.backlog = STREAM_BACKLOG_BYTES
    bench.run()
    assert len(bench.received()) == 4096


def test_a_hang_is_not_ended_by_an_interrupt(bench: Bench) -> None:
    sleeps = []
    bench.on_request = lambda request: (
        sleeps.append(request) if isinstance(request, Sleep) else None
    )
    bench.send("TestWDG")
    bench.send("Exposure", exposure=1)  # wakes
    bench.run()
    assert not sleeps[0].wakeable


def test_a_configuration_survives_the_power_cycle_and_nothing_else_does(bench: Bench) -> None:
    bench.command("setIDMargin", Margin=0.002)
    bench.command("SaveConfig")
    bench.command("setIDMargin", Margin=0.003)
    bench.command("IDStars")
    bench.command("TestWDG")
    bench.power_on()
    shown(bench, "IDMargin", Margin=0.002)
    assert bench.flags() == set()
    values = bench.telemetry("ExtendedIdentification")
    assert (values["WDGResetCount"], values["TcmdCount"]) == (0, 0)
    assert values["ResetCause"] == ResetCause.POWER_ON

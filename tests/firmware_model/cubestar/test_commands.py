"""Every telecommand of the table, executed, and what they have in common."""

import pytest

from cubestack.firmware_model.cubestar.commands import STREAM_BACKLOG_BYTES
from cubestack.firmware_model.interface.cubestar import INTERFACE, ResetCause
from cubestack.firmware_model.mcu.requests import Sleep

from . import effects_node, effects_picture
from .effects import EFFECTS, shown
from .harness import FRAME_US, Harness
from .sky import Sky


@pytest.mark.parametrize("name", [message.name for message in INTERFACE.telecommands])
def test_every_telecommand_does_what_it_says(name: str, unit: Harness, sky: Sky) -> None:
    EFFECTS[name](unit, sky)


def test_every_telecommand_has_an_effect_and_no_other_does(unit: Harness) -> None:
    declared = {message.name for message in INTERFACE.telecommands}
    assert unit.program.commands.handled == declared
    assert EFFECTS.keys() == declared
    shown_by = {effect.__module__ for effect in EFFECTS.values()}
    assert shown_by == {effects_node.__name__, effects_picture.__name__}


def test_telecommands_are_executed_in_order(unit: Harness) -> None:
    for exposure in (1, 2, 3, 4):
        unit.send("Exposure", exposure=exposure)
    shown(unit, "Exposure", exposure=0)
    unit.run()
    shown(unit, "Exposure", exposure=4)


def test_processed_says_when_the_last_telecommand_is_done(unit: Harness) -> None:
    shown(unit, "TcmdProcessed", Processed=1)
    unit.send("CaptureImage")
    unit.send("Exposure", exposure=1)
    shown(unit, "TcmdProcessed", Processed=0)
    unit.run(until_us=unit.now_us + FRAME_US)
    shown(unit, "TcmdProcessed", Processed=0)
    unit.run()
    shown(unit, "TcmdProcessed", Processed=1)


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
    shown(unit, "Exposure", exposure=0)


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


def test_a_hang_is_not_ended_by_an_interrupt(unit: Harness) -> None:
    sleeps = []
    unit.on_request = lambda request: sleeps.append(request) if isinstance(request, Sleep) else None
    unit.send("TestWDG")
    unit.send("Exposure", exposure=1)  # wakes
    unit.run()
    assert not sleeps[0].wakeable


def test_a_configuration_survives_the_power_cycle_and_nothing_else_does(unit: Harness) -> None:
    unit.command("setIDMargin", Margin=0.002)
    unit.command("SaveConfig")
    unit.command("setIDMargin", Margin=0.003)
    unit.command("IDStars", "TestWDG")
    unit.power_on()
    shown(unit, "IDMargin", Margin=0.002)
    assert unit.flags() == set()
    values = unit.telemetry("ExtendedIdentification")
    assert (values["WDGResetCount"], values["TcmdCount"]) == (0, 0)
    assert values["ResetCause"] == ResetCause.POWER_ON

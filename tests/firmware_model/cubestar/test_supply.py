import pytest

from cubestack.firmware_model.cubestar.supply import CHANNELS, OFF_TIME_US, UNDER_CURRENT_MA
from cubestack.firmware_model.interface.cubestar import TaskStatus
from cubestack.firmware_model.mcu.requests import AwaitPin, Request, Sleep, StrobeRead

from .harness import Harness


@pytest.mark.parametrize("channel", CHANNELS)
def test_interrupt_opens_and_main_loop_closes_the_switch(unit: Harness, channel: str) -> None:
    unit.program.supply.overcurrent(channel)
    other = CHANNELS[1 - CHANNELS.index(channel)]
    assert unit.switches == {channel: False, other: True}  # nothing has run since
    assert unit.flags() == {"OverCurrent"}
    values = unit.telemetry("SupplyReport")
    assert (values["LatchUps"], values["PowerCycles"]) == (1, 0)
    assert unit.telemetry("PowerStatus")["Status"] == (channel != "imager")
    unit.run(until_us=unit.now_us + OFF_TIME_US - 100)
    assert not unit.switches[channel]
    unit.run()
    assert unit.switches[channel]
    assert unit.telemetry("SupplyReport")["PowerCycles"] == 1
    assert unit.telemetry("PowerStatus")["Status"] == 1
    assert unit.flags() == {"OverCurrent"}


def test_channel_cut_during_another_pause_stays_off_for_a_full_pause(unit: Harness) -> None:
    start_us = unit.now_us
    unit.program.supply.overcurrent("memory")
    unit.run(until_us=start_us + OFF_TIME_US - 1_000)
    unit.program.supply.overcurrent("imager")
    unit.run(until_us=start_us + OFF_TIME_US + 1_000)
    assert unit.switches == {"memory": True, "imager": False}
    unit.run()
    assert unit.switches == {"memory": True, "imager": True}
    assert unit.now_us - start_us > 2 * OFF_TIME_US


def test_camera_is_set_up_again_after_its_power_cycle(unit: Harness) -> None:
    unit.command("Exposure", exposure=100)
    unit.command("CaptureImage")
    set_up = dict(unit.camera)
    unit.program.supply.overcurrent("imager")
    assert unit.camera == {}
    unit.run()
    unit.command("CaptureImage")
    assert unit.status() is TaskStatus.CAPTURED
    assert unit.camera == set_up


def test_memory_power_cycle_does_not_repeat_the_camera_set_up(unit: Harness) -> None:
    unit.command("CaptureImage")
    count = len(unit.camera_writes)
    unit.program.supply.overcurrent("memory")
    unit.run()
    unit.command("CaptureImage")
    assert len(unit.camera_writes) == count + 2  # enable and disable


def test_memory_latch_up_loses_the_image(lit: Harness) -> None:
    lit.command("CaptureImage")
    lit.program.supply.overcurrent("memory")
    assert not lit.telemetry("PerformanceParameters")["ImageCaptureSuccess"]
    lit.command("ProcessImage")
    assert lit.status() is TaskStatus.DETECTION_FAILED
    assert lit.flags() == {"OverCurrent", "StatusError"}


@pytest.mark.parametrize(
    ("channel", "moment"),
    [("imager", AwaitPin), ("imager", StrobeRead), ("memory", AwaitPin), ("memory", StrobeRead)],
)
def test_latch_up_spoils_only_its_own_capture(lit: Harness, channel: str, moment: type) -> None:

    def strike(request: Request) -> None:
        if isinstance(request, moment):
            lit.program.supply.overcurrent(channel)
            lit.on_request = lambda _request: None
            if channel == "imager":
                lit.never_stored()

    lit.on_request = strike
    lit.command("CaptureAndProcess")
    assert lit.flags() == {"OverCurrent", "ImageCaptureError"} | (
        {"ISDisableError"} if (channel, moment) == ("imager", AwaitPin) else set()
    )
    assert not lit.telemetry("AttitudeQuaternion")["Valid"]
    assert lit.switches[channel]
    lit.command("CaptureAndProcess")
    assert lit.status() is TaskStatus.CALCULATED


def test_under_current_sets_its_flag(unit: Harness) -> None:
    unit.command("CaptureImage")
    assert unit.flags() == set()
    unit.currents["memory"] = UNDER_CURRENT_MA / 2
    unit.command("CaptureImage")
    assert unit.flags() == {"UnderCurrent"}


def test_zero_current_behind_an_open_switch_sets_no_flag(unit: Harness) -> None:
    unit.command("TogglePowerSW")
    assert unit.telemetry("PowerStatus")["Current"] == 0
    unit.program.supply.overcurrent("memory")
    assert unit.telemetry("PowerStatus")["Current"] == 0
    assert unit.flags() == {"OverCurrent"}


def test_power_status_reports_latest_minimum_and_maximum_current(
    unit: Harness, monkeypatch: pytest.MonkeyPatch
) -> None:
    unit.command("CaptureImage")
    values = unit.telemetry("PowerStatus")
    assert (values["Current"], values["MinCurrent"], values["MaxCurrent"]) == (53, 53, 53)

    def draw(channel: str) -> float:
        by_pins = {(1, 0): 151.7, (1, 1): 40.1}
        if channel == "memory":
            return 2.0
        return by_pins.get((unit.pins["ENABLE"], unit.pins["RNW"]), 52.8)

    with monkeypatch.context() as patch:
        patch.setattr(unit, "supply_current_ma", draw)
        unit.command("CaptureImage")
    values = unit.telemetry("PowerStatus")
    assert (values["Current"], values["MinCurrent"], values["MaxCurrent"]) == (53, 40, 152)
    unit.currents["imager"] = 60.0
    unit.command("MCUReset")
    log = unit.telemetry("LogStatus")
    assert (log["Current"], log["MinCurrent"], log["MaxCurrent"]) == (60, 40, 152)


def test_each_channel_is_reported(unit: Harness) -> None:
    unit.currents.update(memory=3.1, imager=101.5)
    values = unit.telemetry("SupplyReport")
    assert (values["SramCurrent"], values["ImagerCurrent"]) == (3.1, 101.5)


def test_open_supply_switch_stays_open_across_a_processor_reset(unit: Harness) -> None:
    unit.command("TogglePowerSW", "MCUReset")
    assert unit.telemetry("PowerStatus")["Status"] == 0
    unit.command("TogglePowerSW")
    assert unit.switches["imager"]
    assert unit.telemetry("PowerStatus")["Status"] == 1


def test_opening_the_switch_of_a_cut_channel_keeps_it_open(unit: Harness) -> None:
    supply = unit.program.supply

    def strike(request: Request) -> None:
        if isinstance(request, Sleep) and unit.switches["imager"]:  # it settles after the pause
            unit.on_request = lambda _request: None
            supply.overcurrent("imager")

    supply.overcurrent("imager")
    unit.send("TogglePowerSW")
    unit.on_request = strike
    unit.run()
    assert unit.telemetry("SupplyReport")["LatchUps"] == 2
    assert unit.telemetry("SupplyReport")["PowerCycles"] == 1
    assert not unit.switches["imager"]
    assert unit.telemetry("PowerStatus")["Status"] == 0
    unit.command("TogglePowerSW")
    assert unit.switches["imager"]


def test_a_capture_with_the_switch_open_fails(unit: Harness) -> None:
    unit.command("TogglePowerSW", "CaptureImage")
    assert unit.status() is TaskStatus.CAPTURE_FAILED
    assert unit.flags() == {"ISSetupError"}


@pytest.mark.parametrize("name", ["Reset", "MCUReset"])
def test_channel_cut_just_before_a_reset_is_switched_on_again(unit: Harness, name: str) -> None:
    def strike(request: Request) -> None:
        unit.on_request = lambda _request: None
        unit.program.supply.overcurrent("imager")

    unit.send(name)
    unit.on_request = strike
    unit.run()
    assert unit.switches["imager"]
    assert unit.resets

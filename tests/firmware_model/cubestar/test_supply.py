"""Over-current, under-current, the load switches and what the host sees of them."""

import pytest

from cubestack.firmware_model.cubestar.supply import CHANNELS, OFF_TIME_US, UNDER_CURRENT_MA
from cubestack.firmware_model.interface.cubestar import TaskStatus
from cubestack.firmware_model.mcu.requests import AwaitPin, Request, Sleep, StrobeRead

from .bench import Bench
from .sky import Sky


@pytest.mark.parametrize("channel", CHANNELS)
def test_the_interrupt_itself_opens_the_switch(bench: Bench, channel: str) -> None:
    bench.program.supply.overcurrent(channel)
    other = CHANNELS[1 - CHANNELS.index(channel)]
    assert bench.switches == {channel: False, other: True}  # nothing has run since
    assert bench.flags() == {"OverCurrent"}
    values = bench.telemetry("SupplyReport")
    assert (values["LatchUps"], values["PowerCycles"]) == (1, 0)
    assert bench.telemetry("PowerStatus")["Status"] == (channel != "imager")


@pytest.mark.parametrize("channel", CHANNELS)
def test_the_main_loop_closes_the_switch_after_a_pause(bench: Bench, channel: str) -> None:
    bench.program.supply.overcurrent(channel)
    bench.run(until_us=bench.now_us + OFF_TIME_US - 100)
    assert not bench.switches[channel]
    bench.run()
    assert bench.switches[channel]
    assert bench.telemetry("SupplyReport")["PowerCycles"] == 1
    assert bench.telemetry("PowerStatus")["Status"] == 1
    assert bench.flags() == {"OverCurrent"}


def test_a_channel_that_is_cut_during_the_pause_has_a_pause_of_its_own(bench: Bench) -> None:
    start_us = bench.now_us
    bench.program.supply.overcurrent("memory")
    bench.run(until_us=start_us + OFF_TIME_US - 1_000)
    bench.program.supply.overcurrent("imager")
    bench.run(until_us=start_us + OFF_TIME_US + 1_000)
    assert bench.switches == {"memory": True, "imager": False}
    bench.run()
    assert bench.switches == {"memory": True, "imager": True}
    assert bench.now_us - start_us > 2 * OFF_TIME_US


def test_the_camera_is_set_up_again_after_its_power_cycle(bench: Bench) -> None:
    bench.command("Exposure", exposure=100)
    bench.command("CaptureImage")
    set_up = dict(bench.camera)
    bench.program.supply.overcurrent("imager")
    assert bench.camera == {}
    bench.run()
    bench.command("CaptureImage")
    assert bench.status() is TaskStatus.CAPTURED
    assert bench.camera == set_up


def test_the_camera_is_not_set_up_twice_otherwise(bench: Bench) -> None:
    bench.command("CaptureImage")
    count = len(bench.camera_writes)
    bench.program.supply.overcurrent("memory")
    bench.run()
    bench.command("CaptureImage")
    assert len(bench.camera_writes) == count + 2  # enable and disable


def test_the_memory_channel_loses_the_picture(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.command("CaptureImage")
    bench.program.supply.overcurrent("memory")
    assert not bench.telemetry("PerformanceParameters")["ImageCaptureSuccess"]
    bench.command("ProcessImage")
    assert bench.status() is TaskStatus.DETECTION_FAILED
    assert bench.flags() == {"OverCurrent", "StatusError"}


@pytest.mark.parametrize(
    ("channel", "moment"),
    [("imager", AwaitPin), ("imager", StrobeRead), ("memory", AwaitPin), ("memory", StrobeRead)],
)
def test_a_latch_up_in_a_capture_spoils_it_and_the_next_one_works(
    bench: Bench, sky: Sky, channel: str, moment: type
) -> None:
    bench.picture = sky.picture

    def strike(request: Request) -> None:
        if isinstance(request, moment):
            bench.program.supply.overcurrent(channel)
            bench.on_request = lambda _request: None
            if channel == "imager":
                bench.never_stored()

    bench.on_request = strike
    bench.send("CaptureAndProcess")
    bench.run()
    assert bench.flags() == {"OverCurrent", "ImageCaptureError"} | (
        {"ISDisableError"} if (channel, moment) == ("imager", AwaitPin) else set()
    )
    assert not bench.telemetry("AttitudeQuaternion")["Valid"]
    assert bench.switches[channel]
    bench.command("CaptureAndProcess")
    assert bench.status() is TaskStatus.CALCULATED


def test_under_current(bench: Bench) -> None:
    bench.command("CaptureImage")
    assert bench.flags() == set()
    bench.currents["memory"] = UNDER_CURRENT_MA / 2
    bench.command("CaptureImage")
    assert bench.flags() == {"UnderCurrent"}


def test_no_current_behind_an_open_switch_is_no_error(bench: Bench) -> None:
    bench.command("TogglePowerSW")
    assert bench.telemetry("PowerStatus")["Current"] == 0
    bench.program.supply.overcurrent("memory")
    assert bench.telemetry("PowerStatus")["Current"] == 0
    assert bench.flags() == {"OverCurrent"}


def test_currents_are_those_of_imager_and_frame_buffer(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.command("CaptureImage")
    values = bench.telemetry("PowerStatus")
    assert (values["Current"], values["MinCurrent"], values["MaxCurrent"]) == (52.8, 52.8, 52.8)

    def draw(channel: str) -> float:
        by_pins = {(1, 0): 151.7, (1, 1): 40.1}
        if channel == "memory":
            return 2.0
        return by_pins.get((bench.pins["ENABLE"], bench.pins["RNW"]), 52.8)

    with monkeypatch.context() as patch:
        patch.setattr(bench, "supply_current_ma", draw)
        bench.command("CaptureImage")
    values = bench.telemetry("PowerStatus")
    assert (values["Current"], values["MinCurrent"], values["MaxCurrent"]) == (52.8, 40.1, 151.7)
    bench.currents["imager"] = 60.0
    bench.command("MCUReset")
    log = bench.telemetry("LogStatus")
    assert (log["Current"], log["MinCurrent"], log["MaxCurrent"]) == (60.0, 40.1, 151.7)


def test_each_channel_is_reported(bench: Bench) -> None:
    bench.currents.update(memory=3.1, imager=101.5)
    values = bench.telemetry("SupplyReport")
    assert (values["SramCurrent"], values["ImagerCurrent"]) == (3.1, 101.5)


def test_an_open_switch_stays_open_over_a_reset_of_the_processor(bench: Bench) -> None:
    bench.command("TogglePowerSW")
    bench.command("MCUReset")
    assert bench.telemetry("PowerStatus")["Status"] == 0
    bench.command("TogglePowerSW")
    assert bench.switches["imager"]
    assert bench.telemetry("PowerStatus")["Status"] == 1


def test_opening_the_switch_of_a_channel_that_is_cut_leaves_it_open(bench: Bench) -> None:
    supply = bench.program.supply

    def strike(request: Request) -> None:
        if isinstance(request, Sleep) and bench.switches["imager"]:  # it settles after the pause
            bench.on_request = lambda _request: None
            supply.overcurrent("imager")

    supply.overcurrent("imager")
    bench.send("TogglePowerSW")
    bench.on_request = strike
    bench.run()
    assert bench.telemetry("SupplyReport")["LatchUps"] == 2
    assert bench.telemetry("SupplyReport")["PowerCycles"] == 1
    assert not bench.switches["imager"]
    assert bench.telemetry("PowerStatus")["Status"] == 0
    bench.command("TogglePowerSW")
    assert bench.switches["imager"]


def test_a_capture_with_the_switch_open_fails(bench: Bench) -> None:
    bench.command("TogglePowerSW")
    bench.command("CaptureImage")
    assert bench.status() is TaskStatus.CAPTURE_FAILED
    assert bench.flags() == {"ISSetupError"}


@pytest.mark.parametrize("name", ["Reset", "MCUReset"])
def test_a_channel_that_is_cut_just_before_a_reset_comes_back(bench: Bench, name: str) -> None:
    def strike(request: Request) -> None:
        bench.on_request = lambda _request: None
        bench.program.supply.overcurrent("imager")

    bench.send(name)
    bench.on_request = strike
    bench.run()
    assert bench.switches["imager"]
    assert bench.resets

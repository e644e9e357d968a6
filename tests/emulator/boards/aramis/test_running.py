import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.boards.aramis.board import ARAMIS_POWER
from cubestack.emulator.scene.attitude import attitude_error_deg
from cubestack.emulator.sim.virtual_time import PS_PER_MS
from cubestack.firmware_model.aramis.measurement import Measuring
from cubestack.firmware_model.interface.aramis import INTERFACE, MeasurementMode, Reason
from cubestack.host.clients.i2c import I2cClient
from cubestack.host.errors import CommandRefusedError

from .conftest import Desk, scene


def test_reports_dead_camera(active: Desk) -> None:
    active.board.camera.power(False, active.board.kernel.now)
    found = active.aramis.measure()
    assert (found.valid, found.reason) == (False, Reason.CAMERA_TIMEOUT)
    assert active.aramis.measure().reason is Reason.CAMERA_SILENT  # it is set up anew, in vain
    assert active.flags() == {"CameraTimeout", "CameraSilent"}
    active.board.camera.power(True, active.board.kernel.now)
    assert active.aramis.measure().valid


def test_unexpected_sensor_window_is_detected_and_restored(active: Desk) -> None:
    def write(address: int, value: int) -> None:
        data = bytes([address]) + value.to_bytes(2, "big")
        assert active.board.camera.i2c_write(0x5D, data, active.board.kernel.now)

    write(0x03, 511)
    assert active.aramis.measure().reason is Reason.CAMERA_FRAME
    write(0x03, 1023)
    write(0x04, 639)
    assert active.aramis.measure().reason is Reason.CAMERA_FRAME
    assert active.flags() == {"CameraFrameError"}


def test_exposure_and_gain_reach_the_sensor_and_registers_can_be_read(active: Desk) -> None:
    active.client.command("SetExposure", Rows=2000)
    active.client.command("SetGain", Gain=8.0)
    active.aramis.measure()
    assert active.board.ppi.stored.exposure_lines == 2000
    for _ in range(2):
        active.command("SelectCameraRegister", Address=0x35)
        register = active.client.telemetry("CameraRegister")
        assert register == {"Address": 0x35, "Value": 0x60, "Valid": 1}
        active.command("WriteCameraRegister", Address=0x35, Value=8)
        active.aramis.measure()  # which sets the gain up anew


def test_downloaded_images_equal_the_captured_ones(active: Desk) -> None:
    active.aramis.measure()
    star = active.aramis.stars()[0]
    number, column = divmod(1280 * round(star.y_px) + round(star.x_px), 128)
    active.command("ImageBlockSet", BlockNumber=number)
    assert active.client.telemetry("ImageBlock")["Block"][column] > 100
    active.command("ImageBlockSet", BlockNumber=9)
    tenth = active.client.telemetry("ImageBlock")["Block"]
    streamed = list(active.client.stream("StreamDownImage", 20))
    assert streamed[9] == tenth
    assert {len(block) for block in streamed} == {128}


def test_loop_runs_at_1_hz(active: Desk) -> None:
    active.client.command("StartLoop", Period=1000, Mode=MeasurementMode.AIDED)
    active.client.pause(10)
    status = active.client.telemetry("LoopStatus")
    assert (status["Iterations"], status["LateIterations"]) == (10, 0)
    assert active.aramis.attitude().mode is MeasurementMode.AIDED
    assert active.error_deg()[0] < 0.01
    active.client.command("StopLoop")
    active.client.pause(1.5)
    done = active.client.telemetry("LoopStatus")["Iterations"]
    active.client.pause(3)
    assert active.client.telemetry("LoopStatus")["Iterations"] == done


def test_counts_late_iterations(active: Desk) -> None:
    """A measurement takes longer than the period: no turn but the first is in time."""
    active.command("SetExposure", Rows=16_383)  # 520 ms
    active.client.command("StartLoop", Period=400, Mode=MeasurementMode.LOST_IN_SPACE)
    active.client.pause(10.0)
    status = active.client.telemetry("LoopStatus")
    assert status["Iterations"] >= 5
    assert status["LateIterations"] in (status["Iterations"], status["Iterations"] - 1)
    assert "TimingError" in active.flags()


def test_below_one_second_capture_overlaps_processing(active: Desk) -> None:
    active.client.command("StartLoop", Period=600, Mode=MeasurementMode.LOST_IN_SPACE)
    active.client.pause(6.05)
    assert active.client.telemetry("LoopStatus")["Iterations"] >= 9
    assert active.aramis.phase_times()["capture"] < 5.0
    assert active.error_deg()[0] < 0.01


def test_attitude_of_a_rotating_satellite_refers_to_the_image_time() -> None:
    desk = Desk(scene(rate_deg_s=(0.02, 0.1, 0.05)))
    desk.aramis.activate()
    desk.client.command("StartLoop", Period=1000, Mode=MeasurementMode.AIDED)
    for _ in range(3):
        desk.client.pause(1.0)
        assert desk.aramis.attitude().valid
        assert desk.error_deg()[0] < 0.01


def test_telecommand_is_rejected_on_i2c_too(desk: Desk) -> None:
    bus = desk.board.i2c()
    client = I2cClient(bus, INTERFACE, wait=bus.wait)
    assert client.telemetry("Identification")["NodeType"] == 6
    with pytest.raises(CommandRefusedError, match="BAD_PARAMETER"):
        client.command("SetExposure", Rows=0)


def test_runs_repeat_exactly() -> None:
    def run() -> list[dict[str, Any]]:
        desk = Desk()
        desk.aramis.activate()
        desk.aramis.measure()
        return [desk.client.telemetry(name) for name in ("Attitude", "PhaseTimes", "StarDetails")]

    assert run() == run()


def test_every_telemetry_frame_can_be_read_at_any_time(desk: Desk) -> None:
    for happens in (lambda: None, desk.aramis.activate, desk.aramis.measure):
        happens()
        for message in INTERFACE.telemetries:
            assert set(desk.client.telemetry(message.name)) == {f.name for f in message.fields}


def test_every_aramis_telecommand_has_a_handler(desk: Desk) -> None:
    assert desk.board.program.commands.handled == {m.name for m in INTERFACE.telecommands}


def test_aramis_phase_times_add_up_to_the_total(active: Desk) -> None:
    active.aramis.measure()
    times = active.aramis.phase_times()
    total = times.pop("total")
    assert sum(times.values()) == pytest.approx(total, rel=0.02)
    assert times["spikes"] > times["centroids"] > 0


def test_saved_settings_survive_a_reset(active: Desk) -> None:
    for save in (False, True):
        active.client.command("SetExposure", Rows=1234)
        if save:
            active.client.command("SaveConfig")
        active.client.command("Reset")
        active.client.pause(0.3)
        assert (active.client.telemetry("Exposure")["Rows"] == 1234) is save
    active.command("ClearConfig")
    assert active.client.telemetry("Exposure")["Rows"] == 6299


@pytest.mark.parametrize(
    ("name", "values"),
    [("SetExposure", {"Rows": 99}), ("SetGain", {"Gain": 2.0}), ("ClearConfig", {})],
)
def test_changed_image_settings_restart_the_background(
    active: Desk, monkeypatch: pytest.MonkeyPatch, name: str, values: dict[str, Any]
) -> None:
    begun: list[Measuring] = []
    monkeypatch.setattr(Measuring, "restart", lambda measuring: begun.append(measuring))
    active.command(name, **values)
    assert len(begun) == 1


def test_average_power_rises_while_the_loop_runs(desk: Desk) -> None:
    desk.client.pause(1.0)
    resting_ma = desk.board.power.charge_mas() / desk.now_s
    desk.aramis.activate()
    desk.client.command("StartLoop", Period=1000, Mode=0)
    desk.client.pause(5.0)
    assert desk.board.power.charge_mas() / desk.now_s > resting_ma + 200 / ARAMIS_POWER.volts


def test_truth_describes_the_requested_frame() -> None:
    desk = Desk(scene(rate_deg_s=(0.0, 0.5, 0.0)))
    assert desk.board.truth() is None
    desk.aramis.activate()
    before_s, after_s = (desk.aramis.measure().image_uptime_s for _ in range(2))
    one, two = desk.board.truth(1), desk.board.truth(2)
    turned = attitude_error_deg(two, one)[0]
    assert turned == pytest.approx(0.5 * (after_s - before_s), abs=0.001)
    assert desk.board.truth(3) is None
    np.testing.assert_array_equal(desk.board.truth(), two)


def test_busy_is_false_while_waiting_for_the_host(active: Desk) -> None:
    active.client.pause(0.1)
    assert not active.board.busy()
    active.client.command("GetAttitude")
    assert active.board.busy()
    active.client.wait_processed(5)
    active.board.kernel.advance_to(active.board.kernel.now + 50 * PS_PER_MS)
    assert not active.board.busy()


PAGE = Path(__file__).parents[4] / "docs" / "sensors" / "protocols-aramis.md"
NEXT_S = 1.5  #: From one request to the next: a measurement is over by then


def test_documented_aramis_protocol_examples_work() -> None:
    blocks = re.findall(r"```wire\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines()]
    sent, received = ([line[3:] for line in lines if line[:3] == way] for way in ("-> ", "<- "))
    assert len(sent) == len(received) == len(lines) / 2 > 0
    line = Desk().board.serial()
    line.read(1, 0.1)
    for request, answer in zip(sent, received, strict=True):
        line.write(bytes.fromhex(request))
        found = b""
        while data := line.read(1000, NEXT_S if not found else 0.01):
            found += data
        assert found.hex(" ") == answer, request
        line.read(1, NEXT_S)


def test_documentation_names_every_use_case_telecommand() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for name in ("Activate", "SetSystemTime", "GetAttitude", "LatchUpAction", "SetBodyRotation"):
        assert name in text

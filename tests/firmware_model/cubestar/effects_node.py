"""Effects of telecommands: node, image sensor, configuration, operation."""

import pytest

from cubestack.firmware_model.cubestar.commands import WATCHDOG_US
from cubestack.firmware_model.interface.cubestar import (
    MemoryTest,
    ResetCause,
    TaskStatus,
)
from cubestack.firmware_model.mcu.requests import Pay, Request, SetPin

from .bench import Bench
from .effects import shown, telecommand
from .sky import Sky

# --- node ---------------------------------------------------------------------------------------


@telecommand("TogglePowerSW")
def toggle_power_sw(bench: Bench, _: Sky) -> None:
    bench.command("TogglePowerSW")
    assert bench.switches == {"memory": True, "imager": False}
    assert bench.telemetry("PowerStatus")["Status"] == 0
    bench.command("TogglePowerSW")
    assert bench.switches == {"memory": True, "imager": True}
    assert bench.telemetry("PowerStatus")["Status"] == 1
    bench.command("CaptureImage")
    assert bench.status() is TaskStatus.CAPTURED


@telecommand("Reset")
def reset(bench: Bench, _: Sky) -> None:
    bench.command("Exposure", exposure=7)
    bench.command("SaveConfig")
    bench.command("Exposure", exposure=9)
    bench.command("SetDiscardDelay", Delay=1)
    bench.telemetry("IDMargin")
    bench.uart(b"noise")
    bench.command("TogglePowerSW")
    bench.command("Reset")
    assert bench.resets == [ResetCause.SYSTEM_REQUEST]
    assert bench.telemetry("ExtendedIdentification")["TcmdCount"] == 0
    assert bench.flags() == set()
    shown(bench, "Exposure", exposure=7)
    assert bench.telemetry("LoopStatus")["DiscardDelay"] == 70
    assert bench.switches["imager"]


@telecommand("MCUReset")
def mcu_reset(bench: Bench, _: Sky) -> None:
    bench.command("Exposure", exposure=9)
    bench.command("TestSRAM")
    bench.command("MCUReset")
    assert bench.resets == [ResetCause.SYSTEM_REQUEST]
    shown(bench, "Exposure", exposure=9)
    assert bench.telemetry("SRAMTestResults")["TestResult"] == MemoryTest.NOT_RUN
    assert bench.telemetry("ExtendedIdentification")["TcmdCount"] == 3
    assert bench.telemetry("ExtendedIdentification")["ResetCause"] == ResetCause.SYSTEM_REQUEST


@telecommand("setDelayTimerTimeout")
def set_delay_timer_timeout(bench: Bench, _: Sky) -> None:
    bench.command("setDelayTimerTimeout", Time=0.4)
    shown(bench, "DelayTime", Timeout=0.4)
    start_us = bench.now_us
    bench.send("Trigger")
    bench.run(until_us=start_us + 3_000_000)
    enabled = [us for us, what in bench.log if what == SetPin("ENABLE", 1)]
    assert enabled[0] - start_us == pytest.approx(400_000 + 70_000, abs=5_000)


@telecommand("ClearWDGResetCounter")
def clear_wdg_reset_counter(bench: Bench, _: Sky) -> None:
    bench.command("TestWDG")
    bench.command("ClearWDGResetCounter")
    assert bench.telemetry("ExtendedIdentification")["WDGResetCount"] == 0
    assert bench.telemetry("LogStatus")["WDGcounter"] == 0


@telecommand("ClearErrorFlags")
def clear_error_flags(bench: Bench, _: Sky) -> None:
    bench.command("IDStars")
    assert bench.flags() == {"StatusError"}
    bench.command("ClearErrorFlags")
    assert bench.flags() == set()


# --- image sensor ---------------------------------------------------------------------------------


@telecommand("Exposure")
def exposure(bench: Bench, _: Sky) -> None:
    bench.command("Exposure", exposure=1000)
    shown(bench, "Exposure", exposure=1000)
    bench.command("CaptureImage")
    assert bench.camera_value("EXPOSURE") == 1000
    assert bench.camera_value("EXPOSURE_RULE") == 0
    bench.command("Exposure", exposure=0)
    bench.command("CaptureImage")
    assert bench.camera_value("EXPOSURE_RULE") == 2


@telecommand("WriteTo_IS_Register")
def write_to_is_register(bench: Bench, _: Sky) -> None:
    bench.command("WriteTo_IS_Register", Reg=0x26, DataH=0, DataL=0x77)
    assert bench.camera_writes[-1] == bytes([0x85, 0x26, 0x77])


@telecommand("ReadFrom_IS_Register")
def read_from_is_register(bench: Bench, _: Sky) -> None:
    bench.camera[0x8527] = 0x42
    bench.command("ReadFrom_IS_Register", Reg=0x27)
    shown(bench, "IS_Register", DataH=0, DataL=0x42)


@telecommand("SetCameraRegisterPage")
def set_camera_register_page(bench: Bench, _: Sky) -> None:
    bench.command("SetCameraRegisterPage", Page=0x81)
    assert bench.telemetry("LoopStatus")["CameraPage"] == 0x81
    bench.command("WriteTo_IS_Register", Reg=0x02, DataH=0, DataL=0x46)
    assert bench.camera == {0x8102: 0x46}
    bench.command("ReadFrom_IS_Register", Reg=0x02)
    shown(bench, "IS_Register", DataH=0, DataL=0x46)


@telecommand("WriteCameraRegister")
def write_camera_register(bench: Bench, _: Sky) -> None:
    bench.command("WriteCameraRegister", Address=0x840B, Value=3)
    assert bench.camera == {0x840B: 3}


@telecommand("SelectCameraRegister")
def select_camera_register(bench: Bench, _: Sky) -> None:
    bench.camera[0x851D] = 7
    bench.command("SelectCameraRegister", Address=0x851D)
    shown(bench, "CameraRegister", Address=0x851D, Value=7, Valid=1)
    bench.camera_refuses = lambda _data: True
    bench.command("SelectCameraRegister", Address=0x851C)
    shown(bench, "CameraRegister", Address=0x851C, Value=0, Valid=0)


@telecommand("SetFrameRate")
def set_frame_rate(bench: Bench, _: Sky) -> None:
    bench.command("SetFrameRate", FrameRate=30)
    assert bench.telemetry("LoopStatus")["FrameRate"] == 30
    bench.command("CaptureImage")
    assert bench.camera_value("FRAMES_PER_SECOND") == 30


@telecommand("SetDiscardDelay")
def set_discard_delay(bench: Bench, _: Sky) -> None:
    bench.command("SetDiscardDelay", Delay=20)
    assert bench.telemetry("LoopStatus")["DiscardDelay"] == 20
    bench.command("CaptureImage")
    assert bench.telemetry("PhaseTimes")["Discard"] == pytest.approx(20_000, abs=100)


@telecommand("SelectImageBank")
def select_image_bank(bench: Bench, _: Sky) -> None:
    bench.command("SelectImageBank", Bank=1)
    assert bench.telemetry("LoopStatus")["Bank"] == 1
    bench.command("CaptureImage")
    assert bench.pins["BANK"] == 1


# --- configuration, tests and operation -----------------------------------------------------------


@telecommand("SaveConfig")
def save_config(bench: Bench, _: Sky) -> None:
    bench.command("Exposure", exposure=5)
    bench.command("setPrincipalPoint", Cx=1.5, Cy=2.5)
    bench.command("SaveConfig")
    bench.power_on()
    shown(bench, "Exposure", exposure=5)
    shown(bench, "PrincipalPoint", Cx=1.5, Cy=2.5)


@telecommand("ReadConfig")
def read_config(bench: Bench, _: Sky) -> None:
    bench.command("Exposure", exposure=5)
    bench.command("SaveConfig")
    bench.command("Exposure", exposure=6)
    bench.command("ReadConfig")
    shown(bench, "Exposure", exposure=5)


@telecommand("ClearConfig")
def clear_config(bench: Bench, _: Sky) -> None:
    bench.command("Exposure", exposure=5)
    bench.command("SaveConfig")
    bench.command("ClearConfig")
    shown(bench, "Exposure", exposure=0)
    bench.command("Exposure", exposure=6)
    bench.power_on()
    shown(bench, "Exposure", exposure=0)


@telecommand("TestSRAM")
def sram_test(bench: Bench, _: Sky) -> None:
    bench.command("CaptureImage")
    bench.command("TestSRAM")
    shown(bench, "SRAMTestResults", TestResult=MemoryTest.PASSED)
    bench.command("DetectStars")
    assert "StatusError" in bench.flags()  # the picture is lost

    def stuck(request: Request) -> None:
        if isinstance(request, Pay):
            bench.external_ram[777_777] |= 0x10

    bench.on_request = stuck
    bench.command("TestSRAM")
    shown(bench, "SRAMTestResults", TestResult=MemoryTest.FAILED)


@telecommand("TestWDG")
def wdg_test(bench: Bench, _: Sky) -> None:
    bench.command("Exposure", exposure=9)
    start_us = bench.now_us
    bench.send("TestWDG")
    bench.run(until_us=start_us + WATCHDOG_US // 2)
    assert bench.telemetry("TcmdProcessed") == {"Processed": 0}  # it hangs, but answers
    bench.run()
    assert bench.now_us - start_us == pytest.approx(WATCHDOG_US, rel=0.01)
    assert bench.resets == [ResetCause.WATCHDOG]
    values = bench.telemetry("ExtendedIdentification")
    assert values["ResetCause"] == ResetCause.WATCHDOG
    assert values["WDGResetCount"] == 1
    assert values["TlmCount"] == 1  # counted while it hung
    shown(bench, "Exposure", exposure=9)
    bench.command("TestWDG")
    assert bench.telemetry("LogStatus")["WDGcounter"] == 2


@telecommand("CaptureAndProcess")
def capture_and_process(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.command("CaptureAndProcess")
    assert bench.status() is TaskStatus.CALCULATED
    values = bench.telemetry("AttitudeQuaternion")
    assert (values["Valid"], values["FrameCounter"]) == (True, 1)
    bench.frame_us = None
    bench.command("CaptureAndProcess")
    assert bench.status() is TaskStatus.CAPTURE_FAILED
    values = bench.telemetry("AttitudeQuaternion")
    assert (values["Valid"], values["FrameCounter"]) == (False, 1)
    assert bench.telemetry("DetectionSummary")["NumStarsDetected"] == 0


@telecommand("ProcessImage")
def process_image(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.command("CaptureImage")
    bench.log.clear()
    bench.command("ProcessImage")
    assert not any(isinstance(what, SetPin) for _, what in bench.log)
    assert bench.status() is TaskStatus.CALCULATED


@telecommand("Trigger")
def trigger(bench: Bench, _: Sky) -> None:
    bench.send("Trigger")
    bench.run(until_us=bench.now_us + 3_900_000)
    values = bench.telemetry("LoopStatus")
    assert values["Running"]
    assert values["Iterations"] == 4


@telecommand("StopLoop")
def stop_loop(bench: Bench, _: Sky) -> None:
    bench.send("Trigger")
    bench.run(until_us=bench.now_us + 1_200_000)
    bench.command("StopLoop")
    assert bench.telemetry("LoopStatus")["Iterations"] == 2  # the one under way was finished
    assert not bench.telemetry("LoopStatus")["Running"]
    bench.run(until_us=bench.now_us + 5_000_000)
    assert bench.telemetry("LoopStatus")["Iterations"] == 2

"""Effects of telecommands: node, image sensor, configuration, operation."""

import pytest

from cubestack.firmware_model.cubestar.commands import WATCHDOG_US
from cubestack.firmware_model.interface.cubestar import MemoryTest, ResetCause, TaskStatus
from cubestack.firmware_model.mcu.requests import Pay, Request, SetPin

from .effects import shown, telecommand
from .harness import Harness
from .sky import Sky


@telecommand("TogglePowerSW")
def toggle_power_sw(unit: Harness, _: Sky) -> None:
    unit.command("TogglePowerSW")
    assert unit.switches == {"memory": True, "imager": False}
    assert unit.telemetry("PowerStatus")["Status"] == 0
    unit.command("TogglePowerSW")
    assert unit.switches == {"memory": True, "imager": True}
    assert unit.telemetry("PowerStatus")["Status"] == 1
    unit.command("CaptureImage")
    assert unit.status() is TaskStatus.CAPTURED


@telecommand("Reset")
def reset(unit: Harness, _: Sky) -> None:
    unit.command("Exposure", exposure=7)
    unit.command("SaveConfig")
    unit.command("Exposure", exposure=9)
    unit.command("SetDiscardDelay", Delay=1)
    unit.telemetry("IDMargin")
    unit.uart(b"noise")
    unit.command("TogglePowerSW", "Reset")
    assert unit.resets == [ResetCause.SYSTEM_REQUEST]
    assert unit.telemetry("ExtendedIdentification")["TcmdCount"] == 0
    assert unit.flags() == set()
    shown(unit, "Exposure", exposure=7)
    assert unit.telemetry("LoopStatus")["DiscardDelay"] == 70
    assert unit.switches["imager"]


@telecommand("MCUReset")
def mcu_reset(unit: Harness, _: Sky) -> None:
    unit.command("Exposure", exposure=9)
    unit.command("TestSRAM", "MCUReset")
    assert unit.resets == [ResetCause.SYSTEM_REQUEST]
    shown(unit, "Exposure", exposure=9)
    assert unit.telemetry("SRAMTestResults")["TestResult"] == MemoryTest.NOT_RUN
    assert unit.telemetry("ExtendedIdentification")["TcmdCount"] == 3
    assert unit.telemetry("ExtendedIdentification")["ResetCause"] == ResetCause.SYSTEM_REQUEST


@telecommand("setDelayTimerTimeout")
def set_delay_timer_timeout(unit: Harness, _: Sky) -> None:
    unit.command("setDelayTimerTimeout", Time=0.4)
    shown(unit, "DelayTime", Timeout=0.4)
    start_us = unit.now_us
    unit.send("Trigger")
    unit.run(until_us=start_us + 3_000_000)
    enabled = [us for us, what in unit.log if what == SetPin("ENABLE", 1)]
    assert enabled[0] - start_us == pytest.approx(400_000 + 70_000, abs=5_000)


@telecommand("ClearWDGResetCounter")
def clear_wdg_reset_counter(unit: Harness, _: Sky) -> None:
    unit.command("TestWDG", "ClearWDGResetCounter")
    assert unit.telemetry("ExtendedIdentification")["WDGResetCount"] == 0
    assert unit.telemetry("LogStatus")["WDGcounter"] == 0


@telecommand("ClearErrorFlags")
def clear_error_flags(unit: Harness, _: Sky) -> None:
    assert unit.flags() == set()
    unit.command("IDStars")
    unit.uart(b"noise")
    assert unit.flags() == {"StatusError", "UART_ProtocolError"}
    unit.command("ClearErrorFlags")
    assert unit.flags() == set()


@telecommand("Exposure")
def exposure(unit: Harness, _: Sky) -> None:
    unit.command("Exposure", exposure=1000)
    shown(unit, "Exposure", exposure=1000)
    unit.command("CaptureImage")
    assert unit.camera_value("EXPOSURE") == 1000
    assert unit.camera_value("EXPOSURE_RULE") == 0
    unit.command("Exposure", exposure=0)
    unit.command("CaptureImage")
    assert unit.camera_value("EXPOSURE_RULE") == 2


@telecommand("WriteTo_IS_Register")
def write_to_is_register(unit: Harness, _: Sky) -> None:
    unit.command("WriteTo_IS_Register", Reg=0x26, DataH=0, DataL=0x77)
    assert unit.camera_writes[-1] == bytes([0x85, 0x26, 0x77])


@telecommand("ReadFrom_IS_Register")
def read_from_is_register(unit: Harness, _: Sky) -> None:
    shown(unit, "IS_Register", DataH=0, DataL=0)
    unit.camera[0x8527] = 0x42
    unit.command("ReadFrom_IS_Register", Reg=0x27)
    shown(unit, "IS_Register", DataH=0, DataL=0x42)


@telecommand("SetCameraRegisterPage")
def set_camera_register_page(unit: Harness, _: Sky) -> None:
    unit.command("SetCameraRegisterPage", Page=0x81)
    assert unit.telemetry("LoopStatus")["CameraPage"] == 0x81
    unit.command("WriteTo_IS_Register", Reg=0x02, DataH=0, DataL=0x46)
    assert unit.camera == {0x8102: 0x46}
    unit.command("ReadFrom_IS_Register", Reg=0x02)
    shown(unit, "IS_Register", DataH=0, DataL=0x46)


@telecommand("WriteCameraRegister")
def write_camera_register(unit: Harness, _: Sky) -> None:
    unit.command("WriteCameraRegister", Address=0x840B, Value=3)
    assert unit.camera == {0x840B: 3}


@telecommand("SelectCameraRegister")
def select_camera_register(unit: Harness, _: Sky) -> None:
    unit.camera[0x851D] = 7
    unit.command("SelectCameraRegister", Address=0x851D)
    shown(unit, "CameraRegister", Address=0x851D, Value=7, Valid=1)
    unit.camera_refuses = lambda _data: True
    unit.command("SelectCameraRegister", Address=0x851C)
    shown(unit, "CameraRegister", Address=0x851C, Value=0, Valid=0)


@telecommand("SetFrameRate")
def set_frame_rate(unit: Harness, _: Sky) -> None:
    unit.command("SetFrameRate", FrameRate=30)
    assert unit.telemetry("LoopStatus")["FrameRate"] == 30
    unit.command("CaptureImage")
    assert unit.camera_value("FRAMES_PER_SECOND") == 30


@telecommand("SetDiscardDelay")
def set_discard_delay(unit: Harness, _: Sky) -> None:
    unit.command("SetDiscardDelay", Delay=20)
    assert unit.telemetry("LoopStatus")["DiscardDelay"] == 20
    unit.command("CaptureImage")
    assert unit.telemetry("PhaseTimes")["Discard"] == pytest.approx(20_000, abs=100)


@telecommand("SelectImageBank")
def select_image_bank(unit: Harness, _: Sky) -> None:
    unit.command("SelectImageBank", Bank=1)
    assert unit.telemetry("LoopStatus")["Bank"] == 1
    unit.command("CaptureImage")
    assert unit.pins["BANK"] == 1


@telecommand("SaveConfig")
def save_config(unit: Harness, _: Sky) -> None:
    unit.command("Exposure", exposure=5)
    unit.command("setPrincipalPoint", Cx=1.5, Cy=2.5)
    unit.command("SaveConfig")
    unit.power_on()
    shown(unit, "Exposure", exposure=5)
    shown(unit, "PrincipalPoint", Cx=1.5, Cy=2.5)


@telecommand("ReadConfig")
def read_config(unit: Harness, _: Sky) -> None:
    unit.command("Exposure", exposure=5)
    unit.command("SaveConfig")
    unit.command("Exposure", exposure=6)
    unit.command("ReadConfig")
    shown(unit, "Exposure", exposure=5)


@telecommand("ClearConfig")
def clear_config(unit: Harness, _: Sky) -> None:
    unit.command("Exposure", exposure=5)
    unit.command("SaveConfig", "ClearConfig")
    shown(unit, "Exposure", exposure=0)
    unit.command("Exposure", exposure=6)
    unit.power_on()
    shown(unit, "Exposure", exposure=0)


@telecommand("TestSRAM")
def sram_test(unit: Harness, _: Sky) -> None:
    shown(unit, "SRAMTestResults", TestResult=MemoryTest.NOT_RUN)
    unit.command("CaptureImage", "TestSRAM")
    shown(unit, "SRAMTestResults", TestResult=MemoryTest.PASSED)
    unit.command("DetectStars")
    assert "StatusError" in unit.flags()  # the picture is lost

    def stuck(request: Request) -> None:
        if isinstance(request, Pay):
            unit.external_ram[777_777] |= 0x10

    unit.on_request = stuck
    unit.command("TestSRAM")
    shown(unit, "SRAMTestResults", TestResult=MemoryTest.FAILED)


@telecommand("TestWDG")
def wdg_test(unit: Harness, _: Sky) -> None:
    unit.command("Exposure", exposure=9)
    start_us = unit.now_us
    unit.send("TestWDG")
    unit.run(until_us=start_us + WATCHDOG_US // 2)
    assert unit.telemetry("TcmdProcessed") == {"Processed": 0}  # it hangs, but answers
    unit.run()
    assert unit.now_us - start_us == pytest.approx(WATCHDOG_US, rel=0.01)
    assert unit.resets == [ResetCause.WATCHDOG]
    values = unit.telemetry("ExtendedIdentification")
    assert values["ResetCause"] == ResetCause.WATCHDOG
    assert values["WDGResetCount"] == 1
    assert values["TlmCount"] == 1  # counted while it hung
    shown(unit, "Exposure", exposure=9)
    unit.command("TestWDG")
    assert unit.telemetry("LogStatus")["WDGcounter"] == 2


@telecommand("CaptureAndProcess")
def capture_and_process(unit: Harness, sky: Sky) -> None:
    unit.picture = sky.picture
    unit.command("CaptureAndProcess")
    assert unit.status() is TaskStatus.CALCULATED
    values = unit.telemetry("AttitudeQuaternion")
    assert (values["Valid"], values["FrameCounter"]) == (True, 1)
    unit.frame_us = None
    unit.command("CaptureAndProcess")
    assert unit.status() is TaskStatus.CAPTURE_FAILED
    values = unit.telemetry("AttitudeQuaternion")
    assert (values["Valid"], values["FrameCounter"]) == (False, 1)
    assert unit.telemetry("DetectionSummary")["NumStarsDetected"] == 0


@telecommand("ProcessImage")
def process_image(unit: Harness, sky: Sky) -> None:
    unit.picture = sky.picture
    unit.command("CaptureImage")
    unit.log.clear()
    unit.command("ProcessImage")
    assert not any(isinstance(what, SetPin) for _, what in unit.log)
    assert unit.status() is TaskStatus.CALCULATED


@telecommand("Trigger")
def trigger(unit: Harness, _: Sky) -> None:
    unit.start_loop(3.9)
    values = unit.telemetry("LoopStatus")
    assert values["Running"]
    assert values["Iterations"] == 4


@telecommand("StopLoop")
def stop_loop(unit: Harness, _: Sky) -> None:
    unit.start_loop(1.2)
    unit.command("StopLoop")
    assert unit.telemetry("LoopStatus")["Iterations"] == 2  # the one under way was finished
    assert not unit.telemetry("LoopStatus")["Running"]
    unit.run(until_us=unit.now_us + 5_000_000)
    assert unit.telemetry("LoopStatus")["Iterations"] == 2

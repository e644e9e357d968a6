"""Values of every telemetry frame, taken when it is asked for."""

from collections.abc import Callable
from typing import Any

from cubestack.firmware_model.cubestar.capture import ImageCapture
from cubestack.firmware_model.cubestar.commands import Commands
from cubestack.firmware_model.cubestar.hardware import CubeStarHardware
from cubestack.firmware_model.cubestar.processing import Processing
from cubestack.firmware_model.cubestar.reports.attitude import AttitudeReports
from cubestack.firmware_model.cubestar.reports.stars import StarReports
from cubestack.firmware_model.cubestar.reports.tables import SETTINGS_SHOWN, TIMES_SHOWN
from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.cubestar.supply import SupplyMonitor
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.interface.cubestar.codes import ImageBlockSize, SwitchState
from cubestack.firmware_model.interface.cubestar.flags import flag_fields
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.node.identification import SERIAL_NUMBER, identification

NODE_TYPE = 5

Values = dict[str, Any]


class Telemetry:
    """Answers telemetry requests; interrupt context, so nothing here waits."""

    def __init__(
        self,
        hardware: CubeStarHardware,
        meter: Meter,
        state: State,
        capture: ImageCapture,
        processing: Processing,
        supply: SupplyMonitor,
        commands: Commands,
        pending: Callable[[], bool],
    ) -> None:
        """Report on the given parts; ``pending``: whether telecommands wait in the queue."""
        self._hardware = hardware
        self._meter = meter
        self._state = state
        self._capture = capture
        self._processing = processing
        self._supply = supply
        self._commands = commands
        self._pending = pending
        self._sources: dict[str, Callable[[], Values]] = {
            "Identification": lambda: identification(INTERFACE, NODE_TYPE, hardware.uptime_us()),
            "ExtendedIdentification": self._extended_identification,
            "ErrorFlags": state.flag_values,
            "TcmdProcessed": self._processed,
            "TaskStatus": lambda: {"taskStatus": state.task_status},
            "StartAndLoopTime": self._loop_times,
            "SRAMTestResults": lambda: {"TestResult": commands.memory_test},
            "PowerStatus": lambda: {"Status": self._switch(), **self._currents()},
            "ImageSetup": INTERFACE.telemetry("ImageSetup").reset_values,
            "IS_Register": lambda: {"DataH": 0, "DataL": capture.sensor.selected_register[1] or 0},
            "ImageBlock": self._image_block,
            "CameraTiming": self._camera_timing,
            "TimingSummary": self._timing_summary,
            "DetectionThresholdValues": self._thresholds,
            "LogStatus": self._log_status,
            "PhaseTimes": self._phase_times,
            "UploadStatus": lambda: {
                "NextBlock": commands.next_block,
                "BlocksReceived": commands.blocks_received,
            },
            "SupplyReport": self._supply_report,
            "CameraRegister": self._camera_register,
            "LoopStatus": self._loop_status,
            **StarReports(processing).sources,
            **AttitudeReports(state, processing, meter).sources,
        }

    def values(self, message: Message) -> Values | None:
        """Values of every field of ``message``; None when the node does not offer it."""
        if message.name in SETTINGS_SHOWN:
            return {
                name: self._state.settings.get(command, field)
                for name, command, field in SETTINGS_SHOWN[message.name]
            }
        if message.name in TIMES_SHOWN:
            latest, longest = self._processing.latest_ms, self._processing.longest_ms
            return {
                name: (longest if is_longest else latest).get(step, 0.0)
                for name, step, is_longest in TIMES_SHOWN[message.name]
            }
        source = self._sources.get(message.name)
        return None if source is None else source()

    # --- node ---------------------------------------------------------------------------------

    def _extended_identification(self) -> Values:
        retained = self._state.retained
        return {
            "SerialNumber": SERIAL_NUMBER,
            "Temperature": self._hardware.temperature_c(),
            "ResetCause": self._hardware.reset_cause,
            "WDGResetCount": retained.watchdog_resets,
            "TcmdCount": retained.telecommands & 0xFFFF,
            "TlmCount": retained.telemetry & 0xFFFF,
        }

    def _processed(self) -> Values:
        return {"Processed": int(not self._pending() and not self._commands.running)}

    def _loop_times(self) -> Values:
        return {
            "StartupTime": self._state.startup_us / 1000,
            "LoopTime": self._state.retained.loop_us / 1000,
            "MaxLoopTime": self._state.retained.longest_loop_us / 1000,
        }

    def _switch(self) -> SwitchState:
        return SwitchState.ON if self._supply.imager_on else SwitchState.OFF

    def _currents(self) -> Values:
        return {
            "Current": self._supply.sample(),
            "MaxCurrent": self._state.retained.highest_ua / 1000,
            "MinCurrent": self._state.retained.lowest_ua / 1000,
        }

    def _log_status(self) -> Values:
        currents = self._currents()
        shown = {f.name: f.flag in self._state.flags for f in flag_fields(log_names=True)}
        return {
            "Temp": self._hardware.temperature_c(),
            "Runtime": self._hardware.uptime_us() // 1_000_000,
            "WDGcounter": self._state.retained.watchdog_resets,
            "Status": self._state.task_status,
            "SW": self._switch(),
            **currents,
            **shown,
        }

    def _supply_report(self) -> Values:
        retained = self._state.retained
        return {
            "SramCurrent": self._hardware.supply_current_ma("memory"),
            "ImagerCurrent": self._hardware.supply_current_ma("imager"),
            "LatchUps": retained.latch_ups,
            "PowerCycles": retained.power_cycles,
        }

    def _loop_status(self) -> Values:
        settings, retained = self._state.settings, self._state.retained
        return {
            "Iterations": retained.iterations,
            "ModeFlag": self._state.mode,
            "FrameRate": settings.get("SetFrameRate", "FrameRate"),
            "DiscardDelay": settings.get("SetDiscardDelay", "Delay"),
            "Bank": settings.get("SelectImageBank", "Bank"),
            "CameraPage": settings.get("SetCameraRegisterPage", "Page"),
            "Running": bool(retained.looping),
        }

    # --- camera and picture -------------------------------------------------------------------

    def _camera_register(self) -> Values:
        address, value = self._capture.sensor.selected_register
        return {"Address": address, "Value": value or 0, "Valid": int(value is not None)}

    def _camera_timing(self) -> Values:
        retained = self._state.retained
        return {
            "SetupTime": retained.camera_setup_us / 1000,
            "ExposureUpdateTime": retained.exposure_setup_us / 1000,
            "CaptureTime": (retained.discard_us + retained.capture_us) / 1000,
        }

    def _timing_summary(self) -> Values:
        retained = self._state.retained
        captured_us = retained.discard_us + retained.capture_us + retained.transfer_us
        return {
            "ImageCaptureTime": captured_us / 1000,
            "DetectionTime": retained.detect_us / 1000,
            "IdentificationTime": retained.match_us / 1000,
        }

    def _image_block(self) -> Values:
        setting = self._state.settings.all("ImageBlockSet")
        length = ImageBlockSize(setting["BlockSize"]).length
        start = setting["BlockNumber"] * length
        longest = ImageBlockSize.BYTES_128.length
        if length > longest:  # 256 bytes come as two reads
            start += longest if self._commands.second_half else 0
            self._commands.second_half = not self._commands.second_half
        data = self._capture.pictures.read_now(start, min(length, longest))
        if data is None:
            self._state.raise_flag("StatusError")
            data = b""
        return {"Block": data.ljust(longest, b"\0")}

    def _phase_times(self) -> Values:
        retained = self._state.retained
        return {
            "Idle": retained.idle_us,
            "Discard": retained.discard_us,
            "Capture": retained.capture_us,
            "Transfer": retained.transfer_us,
            "Detect": retained.detect_us,
            "Match": retained.match_us,
            "Attitude": retained.attitude_us,
            "LoopTotal": retained.loop_us,
        }

    def _thresholds(self) -> Values:
        detection = self._processing.results.detection
        return {
            "DarkThreshold": 0 if detection is None else detection.dark_value,
            **self._state.settings.all("setDetectionThresholds"),
        }

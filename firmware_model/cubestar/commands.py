"""What each telecommand does, executed by the main loop one after the other.

A setting telecommand stores its parameters. Others act at once, or take time; a few end in a reset,
in which telecommands that still wait are lost.
"""

import numpy as np

from cubestack.firmware_model.cubestar.capture import ImageCapture
from cubestack.firmware_model.cubestar.hardware import CubeStarHardware
from cubestack.firmware_model.cubestar.processing import Processing
from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.cubestar.supply import SupplyMonitor
from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.cubestar import IMAGE_BYTES, UPLOAD_BLOCK_BYTES
from cubestack.firmware_model.interface.cubestar.codes import (
    MatchMode,
    MemoryTest,
    ResetCause,
    TestPattern,
)
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import ReadTimer, Routine, pause
from cubestack.firmware_model.node.commands import CommandExecutor
from cubestack.firmware_model.node.queue import QueuedCommand

WATCHDOG_US = 2_000_000
"""Period of the watchdog; assumed, the sources give none."""

STREAM_BACKLOG_BYTES = 512


class Commands(CommandExecutor):
    """Executes telecommands.

    Attributes:
        memory_test: result of the last TestSRAM.
        next_block: upload block behind the latest one.
        blocks_received: upload blocks since UploadImage.
        second_half: the next ImageBlock of 256 bytes is the second half.
    """

    def __init__(
        self,
        hardware: CubeStarHardware,
        meter: Meter,
        state: State,
        capture: ImageCapture,
        processing: Processing,
        supply: SupplyMonitor,
    ) -> None:
        """Act on the given parts of the program."""
        super().__init__(hardware, state.settings)
        self._hardware = hardware
        self._meter = meter
        self._state = state
        self._capture = capture
        self._processing = processing
        self._supply = supply
        self.memory_test = MemoryTest.NOT_RUN
        self.next_block = 0
        self.blocks_received = 0
        self.second_half = False
        self._actions |= {
            "Reset": self._reset,
            "MCUReset": self._reset_processor,
            "ClearWDGResetCounter": self._clear_watchdog_count,
            "ClearErrorFlags": lambda _: state.flags.clear(),
            "ImageBlockSet": self._select_block,
            "setTrackingMode": self._set_hint,
            "ReadConfig": lambda _: state.load_config(),
            "SaveConfig": lambda _: state.save_config(),
            "ClearConfig": lambda _: state.erase_config(),
            "StopLoop": self._stop_loop,
        }
        self._routines |= {
            "TogglePowerSW": self._toggle_supply,
            "WriteTo_IS_Register": self._write_paged_register,
            "ReadFrom_IS_Register": self._read_paged_register,
            "WriteCameraRegister": self._write_register,
            "SelectCameraRegister": self._read_register,
            "CaptureTestPatern": self._test_pattern,
            "CaptureImage": lambda _: capture.get_image(),
            "UploadImage": self._begin_upload,
            "UploadBlock": self._upload_block,
            "StreamDownImage": self._stream_image,
            "DetectStars": lambda _: processing.detect(),
            "IDStars": lambda _: processing.identify(),
            "SelectBestStars": lambda _: processing.select_best(),
            "EstimateAttitude": lambda _: processing.estimate(),
            "TestSRAM": self._test_memory,
            "TestWDG": self._test_watchdog,
            "CaptureAndProcess": self._capture_and_process,
            "ProcessImage": lambda _: processing.process(),
            "Trigger": self._trigger,
        }

    # --- node ---------------------------------------------------------------------------------

    def _toggle_supply(self, _command: QueuedCommand) -> Routine[None]:
        if self._supply.toggle_imager():
            yield from self._capture.sensor.power_up()

    def _reset(self, _command: QueuedCommand) -> None:
        if self._state.retained.imager_off:
            self._supply.toggle_imager()
        self._state.forget()
        self._reset_cause = ResetCause.SYSTEM_REQUEST

    def _reset_processor(self, _command: QueuedCommand) -> None:
        self._reset_cause = ResetCause.SYSTEM_REQUEST

    def _test_watchdog(self, _command: QueuedCommand) -> Routine[None]:
        """Hang; interrupts are still served."""
        yield from pause(WATCHDOG_US)
        self._reset_cause = ResetCause.WATCHDOG

    def _clear_watchdog_count(self, _command: QueuedCommand) -> None:
        self._state.retained.watchdog_resets = 0

    def _test_memory(self, _command: QueuedCommand) -> Routine[None]:
        self._state.retained.image_present = 0
        passed = yield from self._capture.pictures.test_memory()
        self.memory_test = MemoryTest.PASSED if passed else MemoryTest.FAILED

    # --- image sensor -------------------------------------------------------------------------

    def _page(self, command: QueuedCommand) -> int:
        page: int = self._state.settings.get("SetCameraRegisterPage", "Page")
        return page << 8 | int(command.values["Reg"])

    def _write_paged_register(self, command: QueuedCommand) -> Routine[None]:
        yield from self._capture.sensor.write_byte(self._page(command), command.values["DataL"])

    def _write_register(self, command: QueuedCommand) -> Routine[None]:
        values = command.values
        yield from self._capture.sensor.write_byte(values["Address"], values["Value"])

    def _read_paged_register(self, command: QueuedCommand) -> Routine[None]:
        yield from self._capture.sensor.select_register(self._page(command))

    def _read_register(self, command: QueuedCommand) -> Routine[None]:
        yield from self._capture.sensor.select_register(command.values["Address"])

    # --- picture ------------------------------------------------------------------------------

    def _test_pattern(self, command: QueuedCommand) -> Routine[None]:
        row, column = np.ogrid[:ROWS, :COLUMNS]
        match TestPattern(command.values["TestPaternType"]):
            case TestPattern.COLUMN_RAMP:
                pattern = column
            case TestPattern.ROW_RAMP:
                pattern = row
            case TestPattern.DIAGONAL_RAMP:
                pattern = row + column
        pixels = np.broadcast_to(pattern, (ROWS, COLUMNS)).astype(np.uint8)
        yield from self._capture.pictures.write(0, pixels.reshape(-1))
        self._meter.charge(i32_add=IMAGE_BYTES, loop=IMAGE_BYTES)
        yield from self._capture.replaced()

    def _begin_upload(self, _command: QueuedCommand) -> Routine[None]:
        self.next_block = self.blocks_received = 0
        yield from self._capture.pictures.write(0, np.zeros(IMAGE_BYTES, np.uint8))
        self._meter.charge(loop=IMAGE_BYTES)
        yield from self._capture.replaced()

    def _upload_block(self, command: QueuedCommand) -> Routine[None]:
        number, data = int(command.values["BlockNumber"]), bytes(command.values["Data"])
        start = number * UPLOAD_BLOCK_BYTES
        pixels = np.frombuffer(data, np.uint8)
        yield from self._capture.pictures.write(start, pixels)
        self._meter.charge(loop=UPLOAD_BLOCK_BYTES)
        self.next_block = number + 1
        self.blocks_received += 1

    def _select_block(self, _command: QueuedCommand) -> None:
        self.second_half = False

    def _stream_image(self, _command: QueuedCommand) -> Routine[None]:
        step = UPLOAD_BLOCK_BYTES
        for start in range(0, IMAGE_BYTES, step):
            yield from self._await_room(STREAM_BACKLOG_BYTES)
            block = yield from self._capture.pictures.read(start, step)
            self._hardware.uart_send(encode_frame(block))
            self._meter.charge(loop=step)

    # --- stars --------------------------------------------------------------------------------

    def _capture_and_process(self, _command: QueuedCommand) -> Routine[None]:
        if (yield from self._capture.get_image()):
            yield from self._processing.process()
        else:
            self._processing.discard_results()

    def _set_hint(self, _command: QueuedCommand) -> None:
        self._state.retained.hint_present = 1
        self._state.mode = MatchMode.ASSISTED

    # --- loop ---------------------------------------------------------------------------------

    def _trigger(self, _command: QueuedCommand) -> Routine[None]:
        retained = self._state.retained
        if retained.looping:
            self._state.raise_flag(
                "TimerAlreadyRunning" if retained.delaying else "TriggerAlreadySet"
            )
            return
        now_us: int = yield ReadTimer()
        delay_s = float(self._state.settings.get("setDelayTimerTimeout", "Time"))
        retained.looping = retained.delaying = 1
        retained.loop_due_us = now_us + round(1_000_000 * delay_s)

    def _stop_loop(self, _command: QueuedCommand) -> None:
        self._state.retained.looping = self._state.retained.delaying = 0

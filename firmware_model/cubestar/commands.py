"""What each telecommand does, executed by the main loop one after the other."""

from collections.abc import Callable

import numpy as np

from cubestack.firmware_model.costs import Meter
from cubestack.firmware_model.cubestar.capture import COLUMNS, ROWS, ImageCapture
from cubestack.firmware_model.cubestar.host_link import Command
from cubestack.firmware_model.cubestar.processing import Processing
from cubestack.firmware_model.cubestar.settings import SETTING_COMMANDS
from cubestack.firmware_model.cubestar.state import CONFIG_PAGE, State
from cubestack.firmware_model.cubestar.supply import SupplyMonitor
from cubestack.firmware_model.hardware import Hardware, Pay, ReadTimer, Routine, Sleep
from cubestack.firmware_model.interface.cubestar import IMAGE_BYTES, UPLOAD_BLOCK_BYTES
from cubestack.firmware_model.interface.cubestar_codes import (
    MatchMode,
    MemoryTest,
    ResetCause,
    TestPattern,
)
from cubestack.firmware_model.interface.frames import encode_frame

__all__ = ["Commands"]

WATCHDOG_US = 2_000_000
"""Period of the watchdog; ours, the sources give none."""

STREAM_BACKLOG_BYTES = 512
STREAM_PAUSE_US = 20_000

Handler = Callable[[Command], Routine[int | None]]


class Commands:
    """Executes telecommands.

    Attributes:
        running: whether one is being executed.
        memory_test: result of the last TestSRAM.
        next_block: upload block behind the latest one.
        blocks_received: upload blocks since UploadImage.
        second_half: the next ImageBlock of 256 bytes is the second half.
    """

    def __init__(
        self,
        hardware: Hardware,
        meter: Meter,
        state: State,
        capture: ImageCapture,
        processing: Processing,
        supply: SupplyMonitor,
    ) -> None:
        """Act on the given parts of the program."""
        self._hardware = hardware
        self._meter = meter
        self._state = state
        self._capture = capture
        self._processing = processing
        self._supply = supply
        self.running = False
        self.memory_test = MemoryTest.NOT_RUN
        self.next_block = 0
        self.blocks_received = 0
        self.second_half = False
        self._handlers: dict[str, Handler] = {
            "TogglePowerSW": self._toggle_supply,
            "Reset": self._reset,
            "MCUReset": self._reset_processor,
            "ClearWDGResetCounter": self._clear_watchdog_count,
            "ClearErrorFlags": self._clear_flags,
            "WriteTo_IS_Register": self._write_paged_register,
            "ReadFrom_IS_Register": self._read_paged_register,
            "WriteCameraRegister": self._write_register,
            "SelectCameraRegister": self._read_register,
            "CaptureTestPatern": self._test_pattern,
            "CaptureImage": self._capture_image,
            "UploadImage": self._begin_upload,
            "UploadBlock": self._upload_block,
            "ImageBlockSet": self._select_block,
            "StreamDownImage": self._stream_image,
            "DetectStars": self._detect,
            "IDStars": self._identify,
            "SelectBestStars": self._select_best,
            "EstimateAttitude": self._estimate,
            "setTrackingMode": self._set_hint,
            "ReadConfig": self._read_config,
            "SaveConfig": self._save_config,
            "ClearConfig": self._clear_config,
            "TestSRAM": self._test_memory,
            "TestWDG": self._test_watchdog,
            "CaptureAndProcess": self._capture_and_process,
            "ProcessImage": self._process,
            "Trigger": self._trigger,
            "StopLoop": self._stop_loop,
        }

    def execute(self, command: Command) -> Routine[int | None]:
        """Execute ``command``; returns a reset cause when the program has to end in a reset."""
        self.running = True
        name = command.message.name
        if name in SETTING_COMMANDS:
            self._state.settings.put(name, command.values)
        handler = self._handlers.get(name)
        cause = None if handler is None else (yield from handler(command))
        yield Pay()
        self.running = False
        return cause

    # --- node ---------------------------------------------------------------------------------

    def _toggle_supply(self, _command: Command) -> Routine[None]:
        if (yield from self._supply.toggle_imager()):
            yield from self._capture.sensor.power_up()

    def _reset(self, _command: Command) -> Routine[int]:
        self._state.forget()
        yield Pay()
        return ResetCause.SYSTEM_REQUEST

    def _reset_processor(self, _command: Command) -> Routine[int]:
        self._state.retain()
        yield Pay()
        return ResetCause.SYSTEM_REQUEST

    def _test_watchdog(self, _command: Command) -> Routine[int]:
        self._state.retain()
        now_us: int = yield ReadTimer()
        yield Sleep(now_us + WATCHDOG_US, wakeable=False)
        return ResetCause.WATCHDOG

    def _clear_watchdog_count(self, _command: Command) -> Routine[None]:
        self._state.retained.watchdog_resets = 0
        yield Pay()

    def _clear_flags(self, _command: Command) -> Routine[None]:
        self._state.flags.clear()
        yield Pay()

    def _read_config(self, _command: Command) -> Routine[None]:
        self._state.load_config()
        yield Pay()

    def _save_config(self, _command: Command) -> Routine[None]:
        self._state.save_config()
        yield Pay()

    def _clear_config(self, _command: Command) -> Routine[None]:
        self._hardware.flash.erase(CONFIG_PAGE)
        self._state.settings.clear()
        yield Pay()

    def _test_memory(self, _command: Command) -> Routine[None]:
        """Write and read back a pattern and its complement; the picture is lost."""
        memory = self._hardware.external_ram
        passed = True
        pattern = (np.arange(len(memory)) * 167 >> 3).astype(np.uint8)  # differs between rows
        for pass_pattern in (pattern, ~pattern):
            memory[:] = pass_pattern
            passed &= bool(np.array_equal(memory, pass_pattern))
            self._meter.charge(ebi_write=len(memory), ebi_read=len(memory), loop=2 * len(memory))
            yield Pay()
        self._state.retained.image_present = 0
        self.memory_test = MemoryTest.PASSED if passed else MemoryTest.FAILED

    # --- image sensor -------------------------------------------------------------------------

    def _page(self, command: Command) -> int:
        page: int = self._state.settings.get("SetCameraRegisterPage", "Page")
        return page << 8 | int(command.values["Reg"])

    def _write_paged_register(self, command: Command) -> Routine[None]:
        yield from self._capture.sensor.write_byte(self._page(command), command.values["DataL"])

    def _write_register(self, command: Command) -> Routine[None]:
        values = command.values
        yield from self._capture.sensor.write_byte(values["Address"], values["Value"])

    def _read_paged_register(self, command: Command) -> Routine[None]:
        yield from self._capture.sensor.select_register(self._page(command))

    def _read_register(self, command: Command) -> Routine[None]:
        yield from self._capture.sensor.select_register(command.values["Address"])

    # --- picture ------------------------------------------------------------------------------

    def _capture_image(self, _command: Command) -> Routine[None]:
        yield from self._capture.get_image()

    def _test_pattern(self, command: Command) -> Routine[None]:
        row, column = np.indices((ROWS, COLUMNS))
        pattern = {
            TestPattern.COLUMN_RAMP: column,
            TestPattern.ROW_RAMP: row,
            TestPattern.DIAGONAL_RAMP: row + column,
        }[TestPattern(int(command.values["TestPaternType"]))]
        self._capture.image[:] = pattern.astype(np.uint8)
        self._meter.charge(ebi_write=IMAGE_BYTES, i32_add=IMAGE_BYTES, loop=IMAGE_BYTES)
        yield from self._capture.replaced()

    def _begin_upload(self, _command: Command) -> Routine[None]:
        self.next_block = self.blocks_received = 0
        self._capture.image[:] = 0
        self._meter.charge(ebi_write=IMAGE_BYTES, loop=IMAGE_BYTES)
        yield from self._capture.replaced()

    def _upload_block(self, command: Command) -> Routine[None]:
        number, data = int(command.values["BlockNumber"]), bytes(command.values["Data"])
        start = number * UPLOAD_BLOCK_BYTES
        self._hardware.external_ram[start : start + UPLOAD_BLOCK_BYTES] = np.frombuffer(
            data, np.uint8
        )
        self._meter.charge(ebi_write=UPLOAD_BLOCK_BYTES, loop=UPLOAD_BLOCK_BYTES)
        self.next_block = number + 1
        self.blocks_received += 1
        yield Pay()

    def _select_block(self, _command: Command) -> Routine[None]:
        self.second_half = False
        yield Pay()

    def _stream_image(self, _command: Command) -> Routine[None]:
        step = UPLOAD_BLOCK_BYTES
        for start in range(0, IMAGE_BYTES, step):
            while self._hardware.uart_backlog() > STREAM_BACKLOG_BYTES:
                now_us: int = yield ReadTimer()
                yield Sleep(now_us + STREAM_PAUSE_US, wakeable=False)
            block = self._hardware.external_ram[start : start + step].tobytes()
            self._hardware.uart_send(encode_frame(block))
            self._meter.charge(ebi_read=step, loop=step)

    # --- stars --------------------------------------------------------------------------------

    def _detect(self, _command: Command) -> Routine[None]:
        yield from self._processing.detect()

    def _identify(self, _command: Command) -> Routine[None]:
        yield from self._processing.identify()

    def _select_best(self, _command: Command) -> Routine[None]:
        yield from self._processing.select_best()

    def _estimate(self, _command: Command) -> Routine[None]:
        yield from self._processing.estimate()

    def _process(self, _command: Command) -> Routine[None]:
        yield from self._processing.process()

    def _capture_and_process(self, _command: Command) -> Routine[None]:
        if (yield from self._capture.get_image()):
            yield from self._processing.process()
        else:
            self._processing.discard_results()

    def _set_hint(self, _command: Command) -> Routine[None]:
        self._state.retained.hint_present = 1
        self._state.mode = MatchMode.ASSISTED
        yield Pay()

    # --- loop ---------------------------------------------------------------------------------

    def _trigger(self, _command: Command) -> Routine[None]:
        retained = self._state.retained
        now_us: int = yield ReadTimer()
        if retained.looping:
            waiting = retained.iterations == 0 and now_us // 1000 < retained.loop_due_ms
            self._state.raise_flag("TimerAlreadyRunning" if waiting else "TriggerAlreadySet")
            return
        delay_s = float(self._state.settings.get("setDelayTimerTimeout", "Time"))
        retained.looping = 1
        retained.loop_due_ms = now_us // 1000 + round(1000 * delay_s)

    def _stop_loop(self, _command: Command) -> Routine[None]:
        self._state.retained.looping = 0
        yield Pay()

"""Effects of the telecommands, which the main loop executes one after the other.

A setting telecommand stores its parameters. Others act at once, or take time; a few end in a reset,
which discards waiting telecommands.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from cubestack.firmware_model.cubestar.body_list import Body
from cubestack.firmware_model.cubestar.link import TASKS
from cubestack.firmware_model.cubestar.processing.chain import Processing
from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.cubestar import IMAGE_BYTES, UPLOAD_BLOCK_BYTES, codes
from cubestack.firmware_model.mcu.requests import Pay, ReadTimer, Routine, pause
from cubestack.firmware_model.node.commands import CommandExecutor, QueuedCommand

WATCHDOG_US = 2_000_000  #: period of the watchdog; assumed
STREAM_BACKLOG_BYTES = 512


class Commands(CommandExecutor):
    """Executes telecommands."""

    def __init__(self, processing: Processing) -> None:
        self.processing, self.state = processing, processing.state
        self._meter, self._capture = processing.meter, processing.capture
        super().__init__(self.state.hardware, self.state.settings, self.state.switches)
        self.memory_test = codes.MemoryTest.NOT_RUN  #: result of the last TestSRAM
        self.next_block = 0  #: number after that of the latest upload block
        self.blocks_received = 0  #: upload blocks since UploadImage
        self.second_half = False  #: the next ImageBlock of 256 bytes is the second half
        self._actions |= {
            "Reset": self._reset,
            "MCUReset": self._reset_processor,
            "ClearWDGResetCounter": self._clear_watchdog_count,
            "ClearErrorFlags": lambda _: self.state.flags.clear(),
            "setIDMode": self._set_mode,
            "setTrackingMode": self._set_hint,
            "ReadConfig": lambda _: self.state.load_config(),
            "SaveConfig": lambda _: self.state.save_config(),
            "ClearConfig": lambda _: self.state.erase_config(),
            "StopLoop": self._stop_loop,
            "SetBody": self._list_body,
        }
        sensor = self._capture.sensor
        self._routines |= {
            "TogglePowerSW": self._toggle_supply,
            "Exposure": lambda _: sensor.apply_settings(),
            "ImageBlockSet": self._select_block,
            "WriteTo_IS_Register": lambda c: sensor.write_byte(self._paged(c), c.values["DataL"]),
            "ReadFrom_IS_Register": lambda c: sensor.select_register(self._paged(c)),
            "WriteCameraRegister": lambda c: sensor.write_byte(
                c.values["Address"], c.values["Value"]
            ),
            "SelectCameraRegister": lambda c: sensor.select_register(c.values["Address"]),
            "CaptureTestPatern": self._test_pattern,
            "CaptureImage": lambda _: self._capture.get_image(),
            "UploadImage": self._begin_upload,
            "UploadBlock": self._upload_block,
            "StreamDownImage": self._stream_image,
            "DetectStars": lambda _: processing.detect(),
            "IDStars": lambda _: processing.identify(),
            "SelectBestStars": lambda _: processing.select_best(),
            "EstimateAttitude": lambda _: processing.estimate(),
            "TestSRAM": self._test_memory,
            "TestWDG": self._test_watchdog,
            "CaptureAndProcess": lambda _: processing.capture_and_process(),
            "ProcessImage": lambda _: processing.process(),
            "Trigger": self._trigger,
        }
        self._routines |= {name: self._reporting(name, self._routines[name]) for name in TASKS}

    def _reporting(
        self, name: str, routine: Callable[[QueuedCommand], Routine[Any]]
    ) -> Callable[[QueuedCommand], Routine[None]]:
        """``routine`` with the task states of telecommand ``name``; False from it means failed."""
        task = TASKS[name]

        def run(command: QueuedCommand) -> Routine[None]:
            self.state.task_status = task.begun
            yield Pay()
            failed = (yield from routine(command)) is False
            self.state.task_status = task.failed if failed and task.failed else task.done

        return run

    # --- node ---------------------------------------------------------------------------------

    def _toggle_supply(self, _command: QueuedCommand) -> Routine[None]:
        if self._capture.supply.toggle_imager():
            yield from self._capture.sensor.power_up()
            yield from self._capture.sensor.apply_settings()

    def _reset(self, _command: QueuedCommand) -> None:
        if self.state.retained.imager_off:
            self._capture.supply.toggle_imager()
        self.state.forget()
        self._reset_cause = codes.ResetCause.SYSTEM_REQUEST

    def _reset_processor(self, _command: QueuedCommand) -> None:
        self._reset_cause = codes.ResetCause.SYSTEM_REQUEST

    def _test_watchdog(self, _command: QueuedCommand) -> Routine[None]:
        yield from pause(WATCHDOG_US)
        self._reset_cause = codes.ResetCause.WATCHDOG

    def _clear_watchdog_count(self, _command: QueuedCommand) -> None:
        self.state.retained.watchdog_resets = 0

    def _test_memory(self, _command: QueuedCommand) -> Routine[None]:
        self.state.retained.image_present = 0
        passed = yield from self._capture.memory.test_memory()
        self.memory_test = codes.MemoryTest.PASSED if passed else codes.MemoryTest.FAILED

    def _paged(self, command: QueuedCommand) -> int:
        """Address of an image sensor register in the selected page."""
        page: int = self.state.settings.get("SetCameraRegisterPage", "Page")
        return page << 8 | int(command.values["Reg"])

    # --- image --------------------------------------------------------------------------------

    def _test_pattern(self, command: QueuedCommand) -> Routine[bool]:
        row, column = np.ogrid[:ROWS, :COLUMNS]
        pattern = {
            codes.TestPattern.MOVING: column + self.state.retained.frame % 256,
            codes.TestPattern.FIXED: row + column,
            codes.TestPattern.RAMPING: column,
        }[command.values["TestPaternType"]]
        pixels = np.broadcast_to(pattern, (ROWS, COLUMNS)).astype(np.uint8)
        yield from self._capture.memory.write(0, pixels.reshape(-1))
        self._meter.charge(i32_add=IMAGE_BYTES, loop=IMAGE_BYTES)
        return (yield from self._capture.mark_replaced())

    def _begin_upload(self, _command: QueuedCommand) -> Routine[bool]:
        self.next_block = self.blocks_received = 0
        yield from self._capture.memory.write(0, np.zeros(IMAGE_BYTES, np.uint8))
        self._meter.charge(loop=IMAGE_BYTES)
        return (yield from self._capture.mark_replaced())

    def _upload_block(self, command: QueuedCommand) -> Routine[bool]:
        number, pixels = command.values["BlockNumber"], np.frombuffer(command.values["Data"], "u1")
        yield from self._capture.memory.write(number * UPLOAD_BLOCK_BYTES, pixels)
        self._meter.charge(loop=UPLOAD_BLOCK_BYTES)
        self.next_block = number + 1
        self.blocks_received += 1
        return bool(self.state.retained.image_present)  # False: no upload has begun, or it was lost

    def _select_block(self, _command: QueuedCommand) -> Routine[None]:
        yield from ()
        self.second_half = False

    def _stream_image(self, _command: QueuedCommand) -> Routine[None]:
        for start in range(0, IMAGE_BYTES, UPLOAD_BLOCK_BYTES):
            yield from self._await_room(STREAM_BACKLOG_BYTES)
            block = yield from self._capture.memory.read(start, UPLOAD_BLOCK_BYTES)
            self.state.hardware.uart_send(encode_frame(block))
            self._meter.charge(loop=UPLOAD_BLOCK_BYTES)

    # --- stars --------------------------------------------------------------------------------

    def _set_mode(self, command: QueuedCommand) -> None:
        self.processing.transitions.commanded(codes.IdMode(command.values["IdMode"]))

    def _set_hint(self, _command: QueuedCommand) -> None:
        self.state.retained.hint_present = 1
        self.processing.transitions.hinted()

    def _list_body(self, command: QueuedCommand) -> None:
        bodies, uptime_us = self.state.bodies, self.state.hardware.uptime_us()
        bodies[command.values["Number"]] = Body.of_command(command.values, uptime_us, self._meter)
        self.state.bodies = bodies

    # --- loop ---------------------------------------------------------------------------------

    def _trigger(self, _command: QueuedCommand) -> Routine[None]:
        retained = self.state.retained
        if retained.looping:
            flag = "TimerAlreadyRunning" if retained.delaying else "TriggerAlreadySet"
            self.state.raise_flag(flag)
            return
        now_us: int = yield ReadTimer()
        delay_us = 10_000 * int(self.state.settings.get("setDelayTimerTimeout", "Time"))
        retained.looping = retained.delaying = 1
        retained.loop_due_us = now_us + delay_us

    def _stop_loop(self, _command: QueuedCommand) -> None:
        self.state.retained.looping = self.state.retained.delaying = 0

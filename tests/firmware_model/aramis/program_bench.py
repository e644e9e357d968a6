"""A bench for parts of the star tracker's program: performs their requests without a kernel."""

from collections.abc import Callable, Generator
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.memory import FLASH_BYTES, SDRAM_BYTES
from cubestack.firmware_model.interface.cameras.mt9m001 import REGISTERS
from cubestack.firmware_model.mcu.blackfin import BLACKFIN_BF533
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.flash_store import FlashStore
from cubestack.firmware_model.mcu.requests import CameraTransfer, Pay, ReadTimer, Sleep

T = TypeVar("T")


class Bench:
    """Hardware with a timer that runs by what is charged and slept.

    Attributes:
        us: the timer.
        registers: of the camera; None while it does not answer.
        sent: bytes on the UART.
        captures: where frames were asked for.
        on_sleep: called when the program falls asleep, before the time passes.
    """

    def __init__(self) -> None:
        self.sdram: NDArray[np.uint8] = np.zeros(SDRAM_BYTES, np.uint8)
        self.catalogue_flash: NDArray[np.uint8] = np.full(FLASH_BYTES, 0xFF, np.uint8)
        self.flash = FlashStore()
        self.reset_cause = 1
        self.meter = Meter(BLACKFIN_BF533)
        self.us = 0
        self.registers: dict[int, int] | None = {r.address: r.reset for r in REGISTERS}
        self.sent = b""
        self.backlog = 0
        self.captures: list[NDArray[np.uint8]] = []
        self.stopped = 0
        self.camera_on = True
        self.woken = 0
        self.on_sleep: Callable[[], None] = lambda: None

    # --- AramisHardware ---------------------------------------------------------------------------

    def start_capture(self, target: NDArray[np.uint8]) -> None:
        self.captures.append(target)

    def stop_capture(self) -> None:
        self.stopped += 1

    def switch_camera(self, on: bool) -> None:
        self.camera_on = on

    def camera_current_ma(self) -> float:
        return 110.0 if self.camera_on else 0.0

    def uart_send(self, data: bytes) -> None:
        self.sent += data

    def uart_backlog(self) -> int:
        return self.backlog

    def wake(self) -> None:
        self.woken += 1

    def uptime_us(self) -> int:
        return self.us

    # --- requests ---------------------------------------------------------------------------------

    def run(self, routine: Generator[Any, Any, T]) -> T:
        """Perform a routine to its end."""
        answer: Any = None
        while True:
            try:
                request = routine.send(answer)
            except StopIteration as end:
                result: T = end.value
                return result
            self.us += -(-self.meter.take() * 1_000_000 // BLACKFIN_BF533.clock_hz)
            answer = self._perform(request)

    def _perform(self, request: object) -> object:
        match request:
            case Pay():
                return None
            case ReadTimer():
                return self.us
            case Sleep(deadline_us, wakeable):
                if wakeable:
                    woken = self.woken
                    self.on_sleep()
                    if self.woken > woken:
                        return True
                assert deadline_us is not None
                self.us = max(self.us, deadline_us)
                return False
            case CameraTransfer(data, read):
                self.us += 100
                if self.registers is None or not self.camera_on:
                    return None
                for upper, lower in zip(data[1::2], data[2::2], strict=False):
                    self.registers[data[0]] = upper << 8 | lower
                return self.registers.get(data[0], 0).to_bytes(2, "big")[:read]
            case _:
                raise AssertionError(f"unexpected request {request!r}")

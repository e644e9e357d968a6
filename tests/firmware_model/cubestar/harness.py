"""CubeStar's whole program on fake hardware.

The FPGA, the camera's register file and the supplies are as simple as the program can tell them
apart.
"""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.link import CubeStarLink
from cubestack.firmware_model.cubestar.memory import EXTERNAL_RAM_BYTES, RETENTION_BYTES
from cubestack.firmware_model.cubestar.program import CubeStarProgram
from cubestack.firmware_model.interface.cameras.mlx75412 import REGISTERS
from cubestack.firmware_model.interface.cubestar import INTERFACE, ResetCause, TaskStatus
from cubestack.firmware_model.interface.cubestar.switches import DEFAULT_SWITCHES, CubeStarSwitches
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.memory import FlashStore
from cubestack.firmware_model.mcu.requests import (
    AwaitPin,
    CameraTransfer,
    Routine,
    SetPin,
    StrobeRead,
)

from ..host_side import HostSide
from ..runner import Runner

FRAME_US = 386_000
UART_BYTE_US = 174
CAMERA_BYTE_US = 90
SHORTEST_DELAY_US = 10_000
"""From Trigger to the loop's first turn, unless the host sets another delay."""


class Harness(Runner, HostSide):
    """A program on fake hardware."""

    interface = INTERFACE
    boot_us = 3_000
    # no telecommand takes longer than hang_us: a whole picture on the UART takes 91 s

    def __init__(
        self, catalogue: StarCatalogue, switches: CubeStarSwitches = DEFAULT_SWITCHES
    ) -> None:
        HostSide.__init__(self)
        Runner.__init__(self, CORTEX_M3)
        #: algorithms: switches of the program
        self.catalogue, self.algorithms = catalogue, switches
        self.flash = FlashStore()
        self.picture: NDArray[np.uint8] = np.zeros((512, 1024), np.uint8)  #: what the FPGA delivers
        #: camera_refuses: whether the camera leaves a message with these bytes unanswered
        self.camera_refuses: Callable[[bytes], bool] = lambda _data: False
        #: from the FPGA's ENABLE to ACK; None: the frame never comes
        self.frame_us: int | None = FRAME_US
        #: what the channels draw when they are on, in mA
        self.currents = {"memory": 2.0, "imager": 52.8}
        self.camera_writes: list[bytes] = []  #: data of every message on the camera bus
        self.power_on()

    def power_on(self) -> None:
        """Power up, or off and on again: only flash stays."""
        self.external_ram = np.full(EXTERNAL_RAM_BYTES, 0xA5, np.uint8)
        self.retention = bytearray(RETENTION_BYTES)
        self.pins = {"ENABLE": 0, "RNW": 0, "BANK": 0}  #: output pins
        #: camera: the camera's registers by address, as far as they were written
        self.camera: dict[int, int] = {}
        self.switches = {"memory": True, "imager": True}  #: state of the load switches
        self.now_ns = self.backlog = 0
        self.sent.clear()
        self.reset_causes: set[int] = {ResetCause.POWER_ON}
        self._resets_seen = len(self.resets)
        self._ack_us: int | None = None
        self._boot()
        self.run()

    def start(self) -> Routine[None]:
        self.reset_causes.update(self.resets[self._resets_seen :])
        self._resets_seen = len(self.resets)
        self.program = CubeStarProgram(self, self.meter, self.catalogue, switches=self.algorithms)
        return self.program.main()

    @property
    def link(self) -> CubeStarLink:
        return self.program.link

    # --- what the program uses --------------------------------------------------------------------

    def switch_supply(self, channel: str, on: bool) -> None:
        self.switches[channel] = on
        if not on and channel == "imager":
            self.camera.clear()
        if not on and channel == "memory":
            self.external_ram[:] = 0xA5

    def supply_current_ma(self, channel: str) -> float:
        return self.currents[channel] if self.switches[channel] else 0.0

    def temperature_c(self) -> float:
        return 21.5

    # --- what a test uses -------------------------------------------------------------------------

    def never_stored(self) -> None:
        """ACK will not rise for the picture that the FPGA waits for."""
        self._ack_us = None

    def status(self) -> TaskStatus:
        return TaskStatus(self.telemetry("TaskStatus")["taskStatus"])

    def shown(self, frame: str, **values: float) -> None:
        found = self.telemetry(frame)
        assert found == pytest.approx(values, rel=1e-6), f"{frame} shows {found}"

    def start_loop(self, seconds: float) -> int:
        """Trigger the 1 Hz loop and run it for this time; returns its start time."""
        start_us = self.now_us + SHORTEST_DELAY_US
        assert self.send("Trigger") == 0
        self.run(until_us=start_us + round(seconds * 1e6))
        return start_us

    def stored_us(self) -> list[int]:
        """When the FPGA was enabled to store a picture, since the log was cleared."""
        times, rnw = [], 0
        for now_us, request in self.log:
            if isinstance(request, SetPin) and request.pin == "RNW":
                rnw = request.level
            if request == SetPin("ENABLE", 1) and not rnw:
                times.append(now_us)
        return times

    def flags(self) -> set[str]:
        return {name for name, up in self.telemetry("ErrorFlags").items() if up}

    def camera_value(self, register: str) -> int:
        addresses = REGISTERS[register].addresses
        return int.from_bytes(bytes(self.camera[address] for address in addresses), "big")

    # --- pins -------------------------------------------------------------------------------------

    def set_pin(self, pin: str, level: int) -> None:
        if pin != "ENABLE":
            assert not self.pins["ENABLE"], f"{pin} changes while the FPGA is enabled"
        self.pins[pin] = level
        if pin == "ENABLE":
            storing = level and not self.pins["RNW"] and self.switches["imager"]
            never = not storing or self.frame_us is None
            self._ack_us = None if never else self.now_us + (self.frame_us or 0)

    def await_pin(self, request: AwaitPin) -> bool:
        assert request.pin == "ACK"
        deadline_us = self.now_us + request.timeout_us
        stored = self._ack_us is not None and self._ack_us <= deadline_us
        self.now_us = max(self.now_us, self._ack_us or 0) if stored else deadline_us
        return stored

    def strobe(self, request: StrobeRead) -> None:
        assert (self.pins["ENABLE"], self.pins["RNW"]) == (1, 1)
        request.target[:] = self.picture.reshape(-1)
        self.now_us += len(request.target) * request.cycles // 48

    def transfer(self, request: CameraTransfer) -> bytes | None:
        self.now_us += CAMERA_BYTE_US * (len(request.data) + request.read)
        if not self.switches["imager"] or self.camera_refuses(request.data):
            return None
        self.camera_writes.append(request.data)
        address = int.from_bytes(request.data[:2], "big")
        for offset, byte in enumerate(request.data[2:]):
            self.camera[address + offset] = byte
        return bytes(self.camera.get(address + offset, 0) for offset in range(request.read))

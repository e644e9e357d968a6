"""The register-pointer protocol on I2C; interrupt context.

CubeSense thesis, section 6.4.3. Settings and results are those of the node protocol: a setting is
stored at once, before telecommands that wait, and an action waits with them. A slave cannot reject
data, so an action that meets a full queue is lost and raises TcmdBufferOverrun. Each transfer has
one data byte; further ones are not acknowledged.

The image is read ahead of the host into a small buffer; while that is empty the clock is stretched.
An image that cannot be read, because its memory is off, reads as ``FILL``.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from cubestack.firmware_model.cubesense.download import ImageReader
from cubestack.firmware_model.cubesense.hardware import CubeSenseHardware
from cubestack.firmware_model.cubesense.jobs import Background, JobQueue, Measure, TelecommandJob
from cubestack.firmware_model.cubesense.state import State
from cubestack.firmware_model.interface.codec.register_pointer import FILL, PointerRegister
from cubestack.firmware_model.interface.cubesense import INTERFACE, codes, registers
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import Routine

READ_AHEAD_BYTES = 32  #: buffered bytes of the image; it is refilled when half of them are left

_SETTINGS = {
    f"{camera.name}_{name}": (camera, "auto_adjust" if name == "AUTO" else name.lower())
    for camera in codes.Camera
    for name in ("THRESHOLD", "EXPOSURE", "GAIN", "BLUE_GAIN", "RED_GAIN", "AUTO")
}
"""Camera and attribute of its settings, by register."""

_RESULTS: dict[str, tuple[codes.Camera, str, int]] = {
    f"{camera.name}_{name}": (camera, name.lower(), scale)
    for camera in codes.Camera
    for name, scale in (("CAPTURE", 1), ("DETECT", 1), ("POINTS", 1), ("X", 100), ("Y", 100))
}
"""Camera, attribute of its result, and counts per unit, by register."""


@dataclass(eq=False)
class ImageStream:
    """An image that the host reads byte by byte."""

    hardware: CubeSenseHardware
    queue: JobQueue
    reader: ImageReader

    def __post_init__(self) -> None:
        self._work = Background(self._fill)
        self._ahead = bytearray()
        self._sram: codes.Sram | None = None
        self._fetched = 0
        self._turn = 0

    @property
    def active(self) -> bool:
        return self._sram is not None

    def begin(self, sram: codes.Sram | None) -> None:
        """Stream the image in ``sram`` from its first pixel; None ends the stream."""
        self._sram = sram
        self._ahead.clear()
        self._fetched = 0
        self._turn += 1

    def next(self) -> int | None:
        """The next byte; None if the host must wait for it."""
        wanted = self._fetched < codes.IMAGE_BYTES and len(self._ahead) <= READ_AHEAD_BYTES // 2
        if wanted and self.queue.request(self._work):
            self.hardware.wake()
        if self._ahead:
            return self._ahead.pop(0)
        return None if self._fetched < codes.IMAGE_BYTES else FILL

    def _fill(self) -> Routine[None]:
        turn, sram, start = self._turn, self._sram, self._fetched
        count = min(READ_AHEAD_BYTES - len(self._ahead), codes.IMAGE_BYTES - start)
        if sram is None or count <= 0:
            return
        data = yield from self.reader.read_run(sram, start, count)
        if turn != self._turn:  # the pointer moved meanwhile
            return
        self._ahead += data or b""
        self._fetched = codes.IMAGE_BYTES if data is None else start + count


@dataclass(eq=False)
class RegisterLink:
    """Registers behind the pointer, which selects none until a host sets it."""

    hardware: CubeSenseHardware
    meter: Meter
    state: State
    queue: JobQueue
    reader: ImageReader

    def __post_init__(self) -> None:
        self._image = ImageStream(self.hardware, self.queue, self.reader)
        self._register: PointerRegister | None = None
        self._latched = b""
        self._position = 0
        self._written = 0
        self._actions: dict[str, Callable[[Any], None]] = {
            "MEASURE": lambda value: self._measure(codes.Measurement(value), detect=True),
            "CAPTURE": lambda value: self._measure(codes.Measurement(value), detect=False),
            "IMAGE_SRAM": lambda value: setattr(self.state, "image_sram", codes.Sram(value)),
            "CLEAR_OVER_CURRENT": self._clear_over_current,
            "NADIR_SEARCH": self._search,
        }

    def i2c_start(self, read: bool) -> None:
        """Interrupt: the node is addressed, for a write or a ``read``."""
        self._written = 0

    def i2c_write(self, byte: int) -> bool:
        """Interrupt: the pointer, or a data byte; further ones are not acknowledged."""
        self.meter.charge(i2c_interrupt=1)
        self._written += 1
        if self._written == 1:
            self._register = registers.REGISTERS.at(byte)
        elif self._written == 2:
            if self._register is not None:
                self.write(self._register.address, byte)
        else:
            return False
        self._latch()
        return True

    def i2c_read(self) -> int | None:
        """Interrupt: the master reads a byte; None: not available yet, the clock is stretched."""
        if self._image.active:
            byte = self._image.next()
        elif self._position < len(self._latched):
            byte = self._latched[self._position]
            self._position += 1
        else:
            byte = FILL
        if byte is not None:
            self.meter.charge(i2c_interrupt=1)
        return byte

    def i2c_stop(self) -> None:
        self._written = 0

    def _latch(self) -> None:
        """Latch the register's value, all bytes of it at the same time."""
        register = self._register
        self._position = 0
        streams = register is not None and register.streams
        self._image.begin(self.state.image_sram if streams else None)
        if register is None or not register.readable or streams:
            self._latched = b""
            return
        self._latched = self.read(register)

    def read(self, register: PointerRegister) -> bytes:
        """Value of a readable register that is not a stream."""
        self.meter.charge(host_message=1)
        return register.encode(self._value(register.name))

    def _value(self, name: str) -> float:
        if name in _SETTINGS:
            camera, attribute = _SETTINGS[name]
            return float(getattr(self.state.cameras[camera], attribute))
        if name in _RESULTS:
            camera, attribute, scale = _RESULTS[name]
            return float(getattr(self.state.results[camera], attribute)) / scale
        others = {
            "IMAGE_SRAM": self.state.image_sram,
            "NADIR_SEARCH": self.state.nadir_search,
            "OVER_CURRENT": sum(over << sram for sram, over in self.state.over_current.items()),
        }
        return others[name]

    def write(self, address: int, byte: int) -> None:
        """Store ``byte``, or act on it; ignored if it is not allowed."""
        register = registers.REGISTERS.at(address)
        if register is None or register.streams:
            return
        value = register.field.decode(byte)
        if not register.allows(value):
            return
        self.meter.charge(host_message=1)
        if register.name in _SETTINGS:
            camera, attribute = _SETTINGS[register.name]
            setattr(self.state.cameras[camera], attribute, byte)
        else:
            self._actions[register.name](byte)

    def _measure(self, target: codes.Measurement, *, detect: bool) -> None:
        if self._put(Measure(target.camera, target.sram, detect)):
            self.state.schedule(target.camera, target.sram, detect=detect)

    def _clear_over_current(self, selection: int) -> None:
        message = INTERFACE.telecommand("ClearOverCurrent")
        self._put(TelecommandJob(message, {"Selection": selection}))

    def _search(self, value: int) -> None:
        if value == codes.NadirSearch.LINES or self.hardware.mcu_addressing:
            self.state.nadir_search = codes.NadirSearch(value)

    def _put(self, job: Measure | TelecommandJob) -> bool:
        accepted = self.queue.put(job)
        if accepted:
            self.hardware.wake()
        else:
            self.state.raise_flag("TcmdBufferOverrun")
        return accepted

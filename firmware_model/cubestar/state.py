"""What the node remembers: in RAM, in the retention registers, and in flash.

CubeStar thesis, sections 5.3.4 to 5.3.6: the software reset that ends every iteration clears the
RAM; only the newest image and the newest good attitude survive, the attitude and the mode flag in
flash. Settings and counters are ours to keep; they live in the retention registers.
"""

import struct
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.settings import Settings
from cubestack.firmware_model.hardware import Hardware
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.interface.cubestar_codes import MatchMode, TaskStatus

__all__ = ["CONFIG_PAGE", "Attitude", "Retained", "State"]

CONFIG_PAGE = "config"
ATTITUDE_PAGE = "attitude"
MODE_PAGE = "mode"

_FLAGS = INTERFACE.telemetry("ErrorFlags")
_FLAG_NAMES = frozenset(field.name for field in _FLAGS.fields)


@dataclass(frozen=True)
class Attitude:
    """A solved attitude as flash keeps it.

    Attributes:
        quaternion: float32 (4,), scalar last, inertial to camera.
        frame: number of the picture since power-up.
        image_ms: uptime at the picture's mid-exposure, in ms.
        matched: stars used.
        mode: MatchMode by which they were identified.
    """

    quaternion: NDArray[np.float32]
    frame: int
    image_ms: int
    matched: int
    mode: int

    _LAYOUT = struct.Struct("<4fIIBB")

    def pack(self) -> bytes:
        """Contents of the flash page."""
        return self._LAYOUT.pack(
            *self.quaternion, self.frame, self.image_ms, self.matched, self.mode
        )

    @classmethod
    def unpack(cls, page: bytes) -> "Attitude":
        """The attitude in a flash page."""
        *quaternion, frame, image_ms, matched, mode = cls._LAYOUT.unpack(page)
        return cls(np.array(quaternion, np.float32), frame, image_ms, matched, mode)


@dataclass
class Retained:
    """Counters, flags and durations of the main loop that survive a software reset (unsigned)."""

    telecommands: int = 0
    telemetry: int = 0
    watchdog_resets: int = 0
    iterations: int = 0
    frame: int = 0
    image_ms: int = 0
    image_present: int = 0
    looping: int = 0
    hint_present: int = 0
    latch_ups: int = 0
    power_cycles: int = 0
    loop_due_ms: int = 0
    loop_ms: int = 0
    longest_loop_ms: int = 0
    camera_setup: int = 0
    camera_setup_us: int = 0
    idle_us: int = 0
    discard_us: int = 0
    capture_us: int = 0
    transfer_us: int = 0
    detect_us: int = 0
    match_us: int = 0
    attitude_us: int = 0


class State:
    """RAM of the program, restored from the retention registers at boot.

    Attributes:
        settings: parameters of the setting telecommands.
        retained: counters that survive resets.
        flags: names of the raised error flags of telemetry ErrorFlags.
        task_status: value of telemetry TaskStatus.
        startup_ms: uptime at the start of the main loop after this reset, less that at reset.
        restored: whether the retention registers held something.
    """

    _COUNTERS = struct.Struct(f"<{len(fields(Retained))}I")
    _MAGIC = b"CSTR"

    def __init__(self, hardware: Hardware) -> None:
        """Restore from ``hardware``: retention registers, else the configuration in flash."""
        self._hardware = hardware
        self.settings = Settings()
        self.retained = Retained()
        self.flags: set[str] = set()
        self.task_status = TaskStatus.POWERED_UP
        self.startup_ms = 0
        self.restored = hardware.retention[:4] == self._MAGIC
        if self.restored:
            self._restore(bytes(hardware.retention[4:]))
        else:
            self.load_config()

    def _restore(self, data: bytes) -> None:
        self.settings.unpack(data[: Settings.SIZE])
        data = data[Settings.SIZE :]
        flags = _FLAGS.unpack(data[: _FLAGS.length])
        self.flags = {name for name, raised in flags.items() if raised}
        counters = self._COUNTERS.unpack_from(data, _FLAGS.length)
        self.retained = Retained(*counters)

    def retain(self) -> None:
        """Write the retention registers, just before a software reset."""
        counters = [getattr(self.retained, field.name) for field in fields(Retained)]
        data = self._MAGIC + self.settings.pack() + _FLAGS.pack(**self.flag_values())
        data += self._COUNTERS.pack(*counters)
        self._hardware.retention[: len(data)] = data

    def forget(self) -> None:
        """Clear the retention registers, so that the next boot starts as after power-up."""
        self._hardware.retention[:] = bytes(len(self._hardware.retention))

    @property
    def mode(self) -> MatchMode:
        """The firmware's mode flag, in flash; lost in space when it was never written."""
        page = self._hardware.flash.read(MODE_PAGE)
        return MatchMode.LOST_IN_SPACE if page is None else MatchMode(page[0])

    @mode.setter
    def mode(self, mode: MatchMode) -> None:
        if mode != self.mode:
            self._hardware.flash.write(MODE_PAGE, bytes([mode]))

    @property
    def attitude(self) -> Attitude | None:
        """The latest good attitude, in flash."""
        page = self._hardware.flash.read(ATTITUDE_PAGE)
        return None if page is None else Attitude.unpack(page)

    @attitude.setter
    def attitude(self, attitude: Attitude) -> None:
        self._hardware.flash.write(ATTITUDE_PAGE, attitude.pack())

    def flag_values(self) -> dict[str, Any]:
        """Fields of telemetry ErrorFlags."""
        return {name: name in self.flags for name in _FLAG_NAMES}

    def raise_flag(self, name: str) -> None:
        """Raise an error flag; a name that the table lacks is a programming error."""
        if name not in _FLAG_NAMES:
            raise KeyError(f"telemetry ErrorFlags declares no flag {name!r}")
        self.flags.add(name)

    def save_config(self) -> None:
        """Write the settings to flash."""
        self._hardware.flash.write(CONFIG_PAGE, self.settings.pack())

    def load_config(self) -> None:
        """Read the settings from flash; without any, the declared reset values."""
        page = self._hardware.flash.read(CONFIG_PAGE)
        if page is None:
            self.settings.clear()
        else:
            self.settings.unpack(page)

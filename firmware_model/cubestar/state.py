"""The node's memory: RAM, retention registers and flash.

CubeStar thesis, sections 5.3.4 to 5.3.6: the software reset that ends every iteration clears the
RAM; only the newest image and the newest good attitude survive, the attitude and the mode flag in
flash. Settings, flags and counters are kept as well (an extension) in the retention registers
(appendix E: "retention registers in backup power domain").

A page of this part's flash endures 20 000 erasures. The published firmware writes the attitude each
second; if each write erases a whole page of 4 kB, the page lasts 5.6 hours. Switch `flash_store`
models this: each write takes its time, and a worn page keeps its zeros (assumed; the data sheet
only states the number). ``FlashStore.writes`` counts the writes.
"""

import struct
from dataclasses import dataclass, fields
from io import BytesIO

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.body_list import Body, pack_bodies, read_bodies
from cubestack.firmware_model.cubestar.earlier_stars import EarlierStars
from cubestack.firmware_model.cubestar.hardware import CubeStarHardware
from cubestack.firmware_model.interface.codec import attitude_quality, switch_messages
from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.firmware_model.interface.cubestar.codes import MatchMode, ResetCause, TaskStatus
from cubestack.firmware_model.interface.cubestar.switches import DEFAULT_SWITCHES, CubeStarSwitches
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.node.state import NodeState, RunningSwitches, Settings

#: Telecommands whose parameters are stored.
SETTING_COMMANDS = (
    "setDelayTimerTimeout",
    "Exposure",
    "setFocalLength",
    "setFocalLengthComponents",
    "setPrincipalPoint",
    "setRadialDistortionGains",
    "setTangentalDistortionGains",
    "ImageBlockSet",
    "setDetectionRegion",
    "setDetectionThresholds",
    "setStarPixels",
    "setDetectionVariables",
    "setIDMode",
    "setTrackingMode",
    "setIDMargin",
    "SelectImageBank",
    "SetFrameRate",
    "SetDiscardDelay",
    "SetCameraRegisterPage",
)

_SETTINGS_BYTES = sum(INTERFACE.telecommand(name).length for name in SETTING_COMMANDS)

CONFIG_PAGE = "config"
ATTITUDE_PAGE = "attitude"
MODE_PAGE = "mode"
BODIES_PAGE = "bodies"

FLASH_ENDURANCE = 20_000  #: erasures per page: chosen, from the data sheet of the EFM32GG280

_FLAGS = INTERFACE.telemetry("ErrorFlags")
_SWITCHES = INTERFACE.telemetry(switch_messages.SHOWN)
_QUALITY = INTERFACE.telemetry("Quality")

UNRATED: dict[str, Value] = _QUALITY.reset_values() | attitude_quality.UNRATED
"""Values of telemetry Quality for an unrated image."""

_U32 = 0xFFFF_FFFF
_U64 = 0xFFFF_FFFF_FFFF_FFFF


@dataclass(frozen=True)
class Attitude:
    """A solved attitude as stored in flash."""

    quaternion: NDArray[np.float32]  #: float32 (4,), scalar last, inertial to camera
    frame: int  #: number of the image since power-up, modulo 2^32
    image_ms: int  #: uptime at the image's mid-exposure, in ms, modulo 2^32
    matched: int  #: stars used
    mode: int  #: MatchMode by which they were identified
    #: float32 (3, 3), the direction cosine matrix, if it is stored too
    rotation: NDArray[np.float32] | None = None

    LAYOUT = struct.Struct("<4fIIBB")

    def pack(self) -> bytes:
        matrix = b"" if self.rotation is None else self.rotation.astype("<f4").tobytes()
        return matrix + self.LAYOUT.pack(
            *self.quaternion, self.frame & _U32, self.image_ms & _U32, self.matched, self.mode
        )

    @classmethod
    def unpack(cls, page: bytes) -> "Attitude":
        matrix, rest = page[: -cls.LAYOUT.size], page[-cls.LAYOUT.size :]
        *quaternion, frame, image_ms, matched, mode = cls.LAYOUT.unpack(rest)
        rotation = np.frombuffer(matrix, "<f4").reshape(3, 3) if matrix else None
        return cls(np.array(quaternion, np.float32), frame, image_ms, matched, mode, rotation)


@dataclass
class Retained:
    """Counters, times and switches that survive a software reset.

    Unsigned, 64 bits each, so that none overflows in a mission; beyond, they wrap. Times are those
    of the free-running timer.
    """

    telecommands: int = 0
    telemetry: int = 0
    watchdog_resets: int = 0
    reset_us: int = 0
    looping: int = 0
    delaying: int = 0
    iterations: int = 0
    loop_due_us: int = 0
    loop_us: int = 0
    longest_loop_us: int = 0
    frame: int = 0
    image_ms: int = 0
    image_present: int = 0
    image_place: int = 0
    solved: int = 0
    hint_present: int = 0
    confirmed: int = 0
    cut: int = 0
    imager_off: int = 0
    latch_ups: int = 0
    power_cycles: int = 0
    lowest_ua: int = 0
    highest_ua: int = 0
    camera_setup: int = 0
    camera_setup_us: int = 0
    exposure_setup_us: int = 0
    idling_us: int = 0
    idle_us: int = 0
    discard_us: int = 0
    capture_us: int = 0
    transfer_us: int = 0
    detect_us: int = 0
    match_us: int = 0
    attitude_us: int = 0


class State(NodeState):
    """RAM of the program, restored from the retention registers at boot."""

    _MAGIC = b"CSTR"
    _COUNTERS = struct.Struct(f"<{len(fields(Retained))}Q")

    #: Retention registers in use, in bytes.
    RETENTION_SIZE = (
        len(_MAGIC)
        + _SETTINGS_BYTES
        + _SWITCHES.length
        + _FLAGS.length
        + _COUNTERS.size
        + _QUALITY.length
        + Attitude.LAYOUT.size
        + EarlierStars.LAYOUT.size
    )

    def __init__(
        self,
        hardware: CubeStarHardware,
        meter: Meter,
        switches: CubeStarSwitches = DEFAULT_SWITCHES,
    ) -> None:
        """Restore from the retention registers, else from the configuration in flash.

        ``meter`` is charged for erasing and writing flash if the switch says so; ``switches`` are
        those of power-up.
        """
        self.hardware, self._meter = hardware, meter
        super().__init__(field.name for field in _FLAGS.fields)
        #: parameters of the setting telecommands
        self.settings = Settings(INTERFACE, SETTING_COMMANDS)
        #: in use; stored like the settings, but not in flash
        self.switches = RunningSwitches(switches)
        self.retained = Retained()  #: counters that survive resets
        self.quality = dict(UNRATED)  #: of the latest image, values of telemetry Quality
        #: an attitude that contradicts the last believed one and needs confirmation
        self.candidate: Attitude | None = None
        self.earlier = EarlierStars()  #: of the image before; in use with switch ``gyro``
        self.task_status = TaskStatus.POWERING_UP  #: value of telemetry TaskStatus
        self.reset_cause = ResetCause.UNDETERMINED  #: why the program started
        self.startup_us = 0  #: time from the reset to the main loop
        magic = len(self._MAGIC)
        if hardware.retention[:magic] == self._MAGIC:
            data = BytesIO(hardware.retention[magic : self.RETENTION_SIZE])
            self.settings.unpack(data.read(_SETTINGS_BYTES))
            values = _SWITCHES.unpack(data.read(_SWITCHES.length))
            self.switches.now = switch_messages.read_switches(CubeStarSwitches, values)
            flags = _FLAGS.unpack(data.read(_FLAGS.length))
            self.flags = {name for name, raised in flags.items() if raised}
            self.retained = Retained(*self._COUNTERS.unpack(data.read(self._COUNTERS.size)))
            self.quality = _QUALITY.unpack(data.read(_QUALITY.length))
            candidate = Attitude.unpack(data.read(Attitude.LAYOUT.size))
            self.candidate = candidate if candidate.matched else None
            self.earlier = EarlierStars.unpack(data.read())
        else:
            hardware.flash.erase(BODIES_PAGE)
            self.load_config()

    def retain(self) -> None:
        """Write the retention registers, at the instant of a reset.

        The part's program would keep these values there all the time, so that they survive a
        watchdog's reset too.
        """
        candidate = self.candidate
        counters = [getattr(self.retained, field.name) & _U64 for field in fields(Retained)]
        self.hardware.retention[: self.RETENTION_SIZE] = (
            self._MAGIC
            + self.settings.pack()
            + _SWITCHES.pack(**switch_messages.shown_values(self.switches.now))
            + _FLAGS.pack(**self.flag_values())
            + self._COUNTERS.pack(*counters)
            + _QUALITY.pack(**self.quality)
            + (bytes(Attitude.LAYOUT.size) if candidate is None else candidate.pack())
            + self.earlier.pack()
        )

    def forget(self) -> None:
        """Return to the values after power-up; supplies that were cut must still be restored."""
        self.retained = Retained(cut=self.retained.cut)
        self.quality, self.candidate = dict(UNRATED), None
        self.earlier = EarlierStars()
        self.hardware.flash.erase(BODIES_PAGE)
        self.flags.clear()
        self.switches.forget()
        self.load_config()

    @property
    def mode(self) -> MatchMode:
        """The firmware's mode flag, in flash; lost in space if it was never written."""
        page = self.hardware.flash.read(MODE_PAGE)
        return MatchMode.LOST_IN_SPACE if page is None else MatchMode(page[0])

    @mode.setter
    def mode(self, mode: MatchMode) -> None:
        if mode != self.mode:
            self._write(MODE_PAGE, bytes([mode]))

    @property
    def attitude(self) -> Attitude | None:
        """The latest good attitude, in flash; each assignment writes it."""
        page = self.hardware.flash.read(ATTITUDE_PAGE)
        return None if page is None else Attitude.unpack(page)

    @attitude.setter
    def attitude(self, attitude: Attitude) -> None:
        self._write(ATTITUDE_PAGE, attitude.pack())

    @property
    def bodies(self) -> list[Body]:
        """Planets and Moon as listed by the host, in flash; each assignment writes them."""
        return read_bodies(self.hardware.flash.read(BODIES_PAGE))

    @bodies.setter
    def bodies(self, bodies: list[Body]) -> None:
        self._write(BODIES_PAGE, pack_bodies(bodies))

    def _write(self, page: str, data: bytes) -> None:
        if self.switches.now.flash_store == "nothing":
            self.hardware.flash.write(page, data)
        else:
            self._meter.charge(flash_erase=1, flash_program=-(-len(data) // 4))
            self.hardware.flash.write(page, data, FLASH_ENDURANCE)

    def save_config(self) -> None:
        self._write(CONFIG_PAGE, self.settings.pack())

    def load_config(self) -> None:
        """Read the settings from flash; if there are none, use the declared reset values."""
        page = self.hardware.flash.read(CONFIG_PAGE)
        if page is None:
            self.settings.clear()
        else:
            self.settings.unpack(page)

    def erase_config(self) -> None:
        self.hardware.flash.erase(CONFIG_PAGE)
        self.settings.clear()

"""AraMiS' star tracker for programs: the thesis' use cases through any client.

AraMiS thesis, section 2.2. Axes: x right, y down, z out of the lens. Quaternions are scalar last
and turn inertial vectors into camera vectors, v_camera = q v_inertial q*; pixel coordinates count
from the middle of the first pixel.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from zlib import crc32

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cubestack.firmware_model.interface import aramis
from cubestack.firmware_model.interface.aramis import BLOCK_BYTES, MS_PER_DAY, CatalogueState
from cubestack.firmware_model.interface.cameras.mt9m001 import COLUMNS, ROWS
from cubestack.firmware_model.interface.codec.field import Value
from cubestack.host.clients.contract import Columns, DeviceClient, Progress
from cubestack.host.clients.quaternions import (
    AttitudeQuality,
    attitude_columns,
    common,
    described,
    unit_quaternion,
    words,
)
from cubestack.host.errors import StepFailedError, TargetError

PROGRAM_TIMEOUT_S = 300.0
"""Longer than erasing and writing the whole catalogue flash takes."""


@dataclass(frozen=True)
class Attitude:
    """The latest attitude, and how the latest measurement ended."""

    #: float64 (4,), unit length; None before the first attitude
    quaternion: NDArray[np.float64] | None
    valid: bool  #: the latest measurement computed it; otherwise it is older
    #: outcome, reason, mode: of the latest measurement
    outcome: aramis.MeasurementOutcome
    reason: aramis.Reason
    mode: aramis.MeasurementMode
    matched: int  #: stars used for the quaternion
    detected: int  #: stars in the latest picture
    frame: int  #: number of that image
    image_uptime_s: float  #: its mid-exposure, since power-up
    julian_date: float | None  #: the same as a Julian date in days; None until the clock is set


@dataclass(frozen=True)
class Star:
    """A star of the latest image."""

    number: int  #: from 0, brightest first
    #: x_px, y_px: centroid
    x_px: float
    y_px: float
    brightness: float  #: sum of its grey levels
    hipparcos: int | None  #: Hipparcos number; None if not identified


@dataclass(frozen=True, kw_only=True)
class Quality(AttitudeQuality):
    """Quality of the latest attitude and of its image."""

    spread_dn: float  #: range of the sky's level over the field
    blind: float  #: part of the field too bright for stars, 0 to 1
    rejected: int  #: regions rejected by their shape


class Aramis(DeviceClient):
    """A star tracker behind a client; methods raise the client's errors and those named.

    A step's time-out exceeds three of the longest frames, loading the catalogue and processing.
    """

    # --- use cases --------------------------------------------------------------------------------

    def activate(self) -> CatalogueState:
        """Start camera and catalogue; returns the catalogue's state, which may be an error.

        Raises StepFailedError if the star tracker does not become ready.
        """
        self.perform("Activate")
        status = self.client.telemetry("SensorStatus")
        state = aramis.SensorState(int(status["State"]))
        if state is not aramis.SensorState.READY:
            raise StepFailedError(f"the star tracker is not ready after Activate: {state.name}")
        return CatalogueState(int(status["Catalogue"]))

    def deactivate(self) -> None:
        """Stop camera and loop."""
        self.perform("Deactivate")

    def set_time(self, julian_date: float) -> None:
        """Set the clock to a Julian date in days (a float resolves 0.05 ms)."""
        day, part = divmod(julian_date, 1)
        whole, millisecond = divmod(round(part * MS_PER_DAY), MS_PER_DAY)
        self._send("SetSystemTime", JulianDay=int(day) + whole, Millisecond=millisecond)

    def julian_date(self) -> float | None:
        """The star tracker's clock, a Julian date in days; None until it is set."""
        return _julian_date(self.client.telemetry("SystemTime"))

    def measure(
        self, near: ArrayLike | None = None, *, near_rad: tuple[float, float] | None = None
    ) -> Attitude:
        """Measure once and wait for the result.

        Args:
            near: rough inertial unit vector (3,) of the boresight.
            near_rad: the same as right ascension and declination in rad.

        Neither means lost in space; both raise ValueError.
        """
        if near is not None and near_rad is not None:
            raise ValueError("pass the rough direction as near or as near_rad, not both")
        if near is not None:
            x, y, z = (float(part) for part in np.asarray(near, np.float64))
            self.perform("GetAttitudeNearVector", X=x, Y=y, Z=z)
        elif near_rad is not None:
            ascension, declination = near_rad
            self.perform("GetAttitudeNearPoint", RightAscension=ascension, Declination=declination)
        else:
            self.perform("GetAttitude")
        return self.attitude()

    def take_picture(self) -> None:
        """Start the star tracker if necessary, and measure once."""
        self.activate()
        self.measure()

    def attitude(self) -> Attitude:
        """The latest attitude; raises BadAnswerError if it is not a rotation."""
        values = self.client.telemetry("Attitude")
        return Attitude(
            quaternion=_quaternion(values),
            valid=bool(values["Valid"]),
            outcome=aramis.MeasurementOutcome(int(values["Outcome"])),
            reason=aramis.Reason(int(values["Reason"])),
            mode=aramis.MeasurementMode(int(values["Mode"])),
            matched=int(values["Matched"]),
            detected=int(values["Detected"]),
            frame=int(values["FrameCounter"]),
            image_uptime_s=int(values["ImageUptime"]) / 1000,
            julian_date=_julian_date(values),
        )

    def latest(self) -> Columns:
        """The latest attitude, its picture's times, and how the measurement ended."""
        found = self.attitude()
        return {
            "valid": found.valid,
            **attitude_columns(found.quaternion if found.valid else None),
            "image_time_s": found.image_uptime_s,
            "julian_date": found.julian_date,
            "frame": found.frame,
            "mode": found.mode.name,
            "outcome": found.outcome.name,
            "reason": found.reason.name,
            "detected": found.detected,
            "matched": found.matched,
        }

    def observe(self) -> None:
        """As ``take_picture`` does."""
        self.take_picture()

    def summary(self, latest: Columns) -> str:
        """Stars of the latest image, and its attitude or why there is none."""
        attitude = self.attitude()
        if attitude.outcome is aramis.MeasurementOutcome.NOT_MEASURED:
            return "no image since power-up"
        if attitude.valid:
            return described(attitude.detected, attitude.matched, self.quality())
        return f"{attitude.detected} stars detected, no attitude: {words(attitude.reason)}"

    def body_quaternion(self) -> NDArray[np.float64] | None:
        """The latest attitude of the spacecraft (4,), inertial to body; None before the first."""
        return _quaternion(self.client.telemetry("BodyAttitude"))

    def set_body_rotation(self, quaternion: Sequence[float]) -> None:
        """Set the rotation (4,) from the star tracker's axes to the spacecraft's."""
        x, y, z, w = (float(part) for part in quaternion)
        self.perform("SetBodyRotation", Q0=x, Q1=y, Q2=z, Q3=w)

    def latch_up_action(self, off_s: float = 0.1) -> None:
        """Turn the camera unit off, wait, and turn it on again."""
        self._send("LatchUpAction", Step=aramis.LatchUpStep.OFF)
        self.client.pause(off_s)
        self.perform("LatchUpAction", Step=aramis.LatchUpStep.ON)

    def load_catalogue(self, image: bytes, progress: Progress | None = None) -> CatalogueState:
        """Upload a catalogue's ``image``, write it to flash and use it; returns its state.

        Raises StepFailedError if blocks are missing or the star tracker rejects the contents.
        """
        blocks = -(-len(image) // BLOCK_BYTES)
        self._send("BeginCatalogue", Length=len(image), Checksum=crc32(image))
        for number in range(blocks):
            block = image[number * BLOCK_BYTES : (number + 1) * BLOCK_BYTES]
            self._send("CatalogueBlock", BlockNumber=number, Data=block.ljust(BLOCK_BYTES, b"\0"))
            if progress is not None:
                progress(number + 1, blocks)
        self.client.wait_processed(self.step_timeout_s)
        received = int(self.client.telemetry("UploadStatus")["BlocksReceived"])
        if received != blocks:
            raise StepFailedError(f"catalogue: {received} blocks arrived of {blocks}")
        self._send("ClearErrorFlags")
        self._send("CommitCatalogue")
        self.client.wait_processed(PROGRAM_TIMEOUT_S)
        if self.client.telemetry("ErrorFlags")["UploadError"]:
            raise StepFailedError("catalogue rejected: its checksum or contents are wrong")
        return CatalogueState(int(self.client.telemetry("CatalogueStatus")["State"]))

    # --- reports ----------------------------------------------------------------------------------

    def stars(self) -> list[Star]:
        """The stars of the latest image, brightest first; stop the loop first.

        Raises BadAnswerError if the list is incomplete.
        """
        detected = int(self.client.telemetry("DetectionSummary")["Detected"])
        return [
            Star(
                number=number,
                x_px=float(record["X"]),
                y_px=float(record["Y"]),
                brightness=float(record["Brightness"]),
                hipparcos=int(record["Hipparcos"]) if record["Identified"] else None,
            )
            for number, record in self._records("StarDetails", detected).items()
        ]

    def quality(self) -> Quality:
        values = self.client.telemetry("Quality")
        return Quality(
            **common(values),
            reason=aramis.Reason(int(values["Reason"])),
            spread_dn=float(values["Spread"]),
            blind=float(values["Blind"]),
            rejected=int(values["Rejected"]),
        )

    def phase_times(self) -> dict[str, float]:
        """Duration of each step of the latest measurement in ms, by its lower-case name."""
        values = self.client.telemetry("PhaseTimes")
        return {name.lower(): int(value) / 1000 for name, value in values.items()}

    def image(self, progress: Progress | None = None) -> NDArray[np.uint8]:
        """The latest image, (1024, 1280), as one stream of blocks; UART only.

        A lost block cannot be repeated: raises BadAnswerError or NoAnswerError then, and TypeError
        on I2C.
        """
        data = self._stream(
            "StreamDownImage", aramis.IMAGE_BYTES // BLOCK_BYTES, BLOCK_BYTES, progress
        )
        return np.frombuffer(data, np.uint8).reshape(ROWS, COLUMNS)

    def picture(
        self, source: str | None = None, progress: Progress | None = None
    ) -> NDArray[np.uint8]:
        """The latest image, as ``image``; raises TargetError on I2C."""
        try:
            return self.image(progress)
        except TypeError:
            raise TargetError("AraMiS sends its image over a serial line only") from None


def _julian_date(values: dict[str, Value]) -> float | None:
    day, millisecond = int(values["JulianDay"]), int(values["Millisecond"])
    return day + millisecond / MS_PER_DAY if day else None


def _quaternion(values: dict[str, Value]) -> NDArray[np.float64] | None:
    """The quaternion of a frame; None if all zero, before the first attitude."""
    return unit_quaternion(values) if any(values[f"Q{index}"] for index in range(4)) else None

"""CubeStar for programs: images, attitude, stars and times, through any client.

Interface of the CubeSpace family, version 3, with this project's extensions. Axes: x right, y
down, z out of the lens. Quaternions are scalar last and turn inertial vectors into camera vectors,
v_camera = q v_inertial q*; pixel coordinates count from the middle of the first pixel.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.interface import cubestar
from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS
from cubestack.firmware_model.interface.cubestar import (
    Disc,
    ImageBlockSize,
    MatchMode,
    RateOutcome,
    Reason,
    TaskStatus,
)
from cubestack.firmware_model.interface.cubestar.extensions import FIRST_BODY
from cubestack.host.clients.contract import Columns, DeviceClient, Progress
from cubestack.host.clients.quaternions import (
    AttitudeQuality,
    attitude_columns,
    common,
    described,
    pointing_deg,
    unit_quaternion,
    words,
)
from cubestack.host.errors import BadAnswerError, StepFailedError

#: The tasks from this one on are about an image.
_FIRST_OF_IMAGE = TaskStatus.RECEIVING_IMAGE


@dataclass(frozen=True)
class Attitude:
    """An attitude as the node reports it."""

    quaternion: NDArray[np.float64]  #: float64 (4,), unit length
    valid: bool  #: the latest image gave it; otherwise it is older, or none
    matched: int  #: stars used
    mode: MatchMode  #: mode that identified them
    frame: int  #: number of the image since power-up
    image_time_s: float  #: uptime at mid-exposure

    @property
    def boresight(self) -> NDArray[np.float64]:
        x, y, z, w = self.quaternion
        return np.array([2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z])

    @property
    def ra_deg(self) -> float:
        """Right ascension of the boresight, 0 to 360."""
        return pointing_deg(self.quaternion)[0]

    @property
    def dec_deg(self) -> float:
        """Declination of the boresight."""
        return pointing_deg(self.quaternion)[1]


@dataclass(frozen=True, kw_only=True)
class Quality(AttitudeQuality):
    """Quality of the latest image's attitude as the node rates it (profile ``extended``).

    An unknown covariance has pi^2 on its diagonal.
    """

    frame: int  #: number of the image since power-up
    background_range_dn: float  #: range of the sky's brightness over the image
    saturated: float  #: share of saturated pixels, 0 to 1
    elongated: int  #: areas elongated to streaks


@dataclass(frozen=True)
class BodyRate:
    """Rate between the two latest images, from their stars (switch ``gyro``)."""

    outcome: RateOutcome  #: why there is no rate, or MEASURED
    rate_rad_s: NDArray[np.float64]  #: (3,) about the camera's axes; zeros without a rate
    sigmas_rad_s: NDArray[np.float64]  #: (3,) standard deviations that the node claims
    matched: int  #: stars in both images
    interval_s: float  #: time between the two exposures, by the node's timer
    frame: int  #: number of the later image since power-up

    @property
    def valid(self) -> bool:
        return self.outcome is RateOutcome.MEASURED


@dataclass(frozen=True)
class ListedBody:
    """A planet or the Moon for the node's list (switch ``bodies``)."""

    direction: NDArray[np.float64]  #: (3,) inertial, seen from the satellite, any length
    minutes: int  #: how long the direction holds; 0 removes the body
    accuracy_rad: float = 0.0  #: standard deviation of the direction in each axis
    radius_rad: float = 0.0  #: angular radius of the Moon; 0 for a planet


@dataclass(frozen=True)
class BodiesSeen:
    """Planets and Moon in the latest image."""

    listed: int  #: bodies whose direction holds
    named: int  #: planets identified
    used: int  #: planets that are known well enough for the attitude
    disc: Disc  #: the Moon where the attitude puts it
    disc_apart_rad: float  #: angle between the middle of its lit part and that place


@dataclass(frozen=True)
class Star:
    """A detected star."""

    number: int  #: from 0, in order of detection
    #: x_px, y_px: measured centroid
    x_px: float
    y_px: float
    #: x_undistorted_px, y_undistorted_px: the same without distortion
    x_undistorted_px: float
    y_undistorted_px: float
    pixels: int  #: pixels of its area
    intensity: int  #: sum over the centroiding window in DN
    hipparcos: int | None  #: Hipparcos number; None if not identified, or not a star
    body: int | None = None  #: number of the planet in the list of bodies


class CubeStar(DeviceClient):
    """A CubeStar behind a client; methods raise the client's errors and those named.

    A step's time-out exceeds two frames at the lowest frame rate, a transfer and the processing.
    """

    def configure(self, settings: Mapping[str, Mapping[str, object]]) -> None:
        """Send telecommands, name to parameters, as ``Calibration.settings`` has them."""
        for name, parameters in settings.items():
            self.perform(name, **parameters)

    def capture(self) -> None:
        """Capture an image; raises StepFailedError if none arrived."""
        self.perform("CaptureImage")
        status = self.task_status()
        if status is not TaskStatus.CAPTURED:
            raise StepFailedError(f"no image captured: task status {status.name}")

    def take_picture(self) -> None:
        """As ``capture`` does."""
        self.capture()

    def capture_and_process(self) -> TaskStatus:
        """Capture an image, detect, identify and estimate; returns the last step reached."""
        self.perform("CaptureAndProcess")
        return self.task_status()

    def process_image(self) -> TaskStatus:
        """Detect, identify and estimate with the image in memory; returns the last step reached."""
        self.perform("ProcessImage")
        return self.task_status()

    def observe(self) -> None:
        """As ``capture_and_process`` does."""
        self.capture_and_process()

    def task_status(self) -> TaskStatus:
        """The node's last task; raises BadAnswerError for an unknown status."""
        value = int(self.client.telemetry("TaskStatus")["taskStatus"])
        try:
            return TaskStatus(value)
        except ValueError:
            raise BadAnswerError(f"telemetry TaskStatus: unknown status {value}") from None

    def picture(
        self, source: str | None = None, progress: Progress | None = None
    ) -> NDArray[np.uint8]:
        """The image in memory, as ``download_image``; there is only one memory."""
        return self.download_image(progress)

    def upload(self, picture: NDArray[np.uint8], progress: Progress | None = None) -> None:
        """As ``upload_image``."""
        self.upload_image(picture, progress)

    def download_image(self, progress: Progress | None = None) -> NDArray[np.uint8]:
        """The image in memory, (512, 1024) with the first row on top.

        It uses blocks of 128 bytes. One read carries one block, so a lost answer can be repeated;
        blocks of 256 bytes take two reads and could not.
        """
        size = ImageBlockSize.BYTES_128
        image = np.empty((cubestar.IMAGE_BYTES // size.length, size.length), np.uint8)
        for number in range(len(image)):
            self.perform("ImageBlockSet", BlockNumber=number, BlockSize=size)
            block = self.client.telemetry("ImageBlock")["Block"]
            assert isinstance(block, bytes)
            image[number] = np.frombuffer(block, np.uint8)
            if progress is not None:
                progress(number + 1, len(image))
        return image.reshape(ROWS, COLUMNS)

    def stream_image(self, progress: Progress | None = None) -> NDArray[np.uint8]:
        """The image in memory, (512, 1024), as one stream of blocks: faster, UART only.

        A lost block cannot be repeated: raises BadAnswerError or NoAnswerError then, and TypeError
        on I2C.
        """
        length = ImageBlockSize.BYTES_128.length
        data = self._stream("StreamDownImage", cubestar.IMAGE_BYTES // length, length, progress)
        return np.frombuffer(data, np.uint8).reshape(ROWS, COLUMNS)

    def upload_image(self, image: NDArray[np.uint8], progress: Progress | None = None) -> None:
        """Upload ``image``, uint8 (512, 1024), to the image memory.

        It clears the memory first and sends no black blocks. Raises ValueError for another shape or
        type, StepFailedError if blocks were lost.
        """
        if image.shape != (ROWS, COLUMNS) or image.dtype != np.uint8:
            raise ValueError(
                f"an uploaded image is uint8 {(ROWS, COLUMNS)}, not {image.dtype} {image.shape}"
            )
        self.perform("UploadImage")
        blocks = image.reshape(-1, cubestar.UPLOAD_BLOCK_BYTES)
        lit = np.flatnonzero(blocks.any(axis=1))
        for done, number in enumerate(lit, start=1):
            self._send("UploadBlock", BlockNumber=int(number), Data=blocks[number].tobytes())
            if progress is not None:
                progress(done, len(lit))
        self.client.wait_processed(self.step_timeout_s)
        received = int(self.client.telemetry("UploadStatus")["BlocksReceived"])
        if received != len(lit):
            raise StepFailedError(f"upload: {received} blocks arrived of {len(lit)}")

    def attitude(self) -> Attitude:
        """The latest attitude in full precision; raises BadAnswerError if it is not a rotation."""
        values = self.client.telemetry("AttitudeQuaternion")
        return Attitude(
            quaternion=unit_quaternion(values),
            valid=bool(values["Valid"]),
            matched=int(values["Matched"]),
            mode=MatchMode(int(values["Mode"])),
            frame=int(values["FrameCounter"]),
            image_time_s=int(values["ImageTime"]) / 1000.0,
        )

    def quality(self) -> Quality:
        """Quality of the latest image's attitude; raises BadAnswerError for impossible values."""
        values = self.client.telemetry("Quality")
        return Quality(
            **common(values),
            reason=Reason(int(values["Reason"])),
            frame=int(values["FrameCounter"]),
            background_range_dn=float(values["BackgroundRange"]),
            saturated=float(values["Saturated"]),
            elongated=int(values["Elongated"]),
        )

    def body_rate(self) -> BodyRate:
        """The stellar gyro's result; a software reset of the loop discards it."""
        values = self.client.telemetry("StellarGyro")
        return BodyRate(
            outcome=RateOutcome(int(values["Outcome"])),
            rate_rad_s=np.array([float(values[f"Rate{axis}"]) for axis in "XYZ"]),
            sigmas_rad_s=np.array([float(values[f"Sigma{axis}"]) for axis in "XYZ"]),
            matched=int(values["Matched"]),
            interval_s=int(values["Interval"]) / 1e6,
            frame=int(values["FrameCounter"]),
        )

    def list_body(self, number: int, body: ListedBody) -> None:
        """Put ``body`` at place ``number``, 0 to 7, of the node's list, for the images from now on.
        A node without power forgets the list."""
        x, y, z = body.direction
        self.perform(
            "SetBody",
            Number=number,
            RightAscension=float(np.arctan2(y, x)),
            Declination=float(np.arctan2(z, np.hypot(x, y))),
            Radius=body.radius_rad,
            Accuracy=body.accuracy_rad,
            Minutes=body.minutes,
        )

    def bodies_seen(self) -> BodiesSeen:
        """What came of the list in the latest image; a software reset of the loop discards it."""
        values = self.client.telemetry("Bodies")
        return BodiesSeen(
            listed=int(values["Listed"]),
            named=int(values["Named"]),
            used=int(values["Used"]),
            disc=Disc(int(values["Disc"])),
            disc_apart_rad=float(values["DiscApart"]),
        )

    def latest(self) -> Columns:
        """The latest attitude with its image's time, the task's state and the stars."""
        found = self.attitude()
        return {
            "valid": found.valid,
            **attitude_columns(found.quaternion if found.valid else None),
            "image_time_s": found.image_time_s,
            "frame": found.frame,
            "mode": found.mode.name,
            "matched": found.matched,
            "task": self.task_status().name,
        }

    def summary(self, latest: Columns) -> str:
        """Stars of the latest image, and its attitude or why there is none."""
        detected = int(self.client.telemetry("DetectionSummary")["NumStarsDetected"])
        begun = latest["frame"] or detected or TaskStatus[str(latest["task"])] >= _FIRST_OF_IMAGE
        if not begun:
            return "no image since power-up"
        quality = self.quality()
        if latest["valid"]:
            identified = int(self.client.telemetry("NumIdStars")["numIdStars"])
            return described(detected, identified, quality)
        rated = quality.reason is not Reason.NOT_RATED
        why = words(quality.reason if rated else self.task_status())
        return f"{detected} stars detected, no attitude: {why}"

    def coarse_quaternion(self) -> NDArray[np.float64]:
        """The latest quaternion (4,) of the published telemetry, in steps of 1e-4.

        For a node without this project's extensions.
        """
        values = self.client.telemetry("AttitudeData")
        return unit_quaternion(values, "Qbar")

    def stars(self) -> list[Star]:
        """The stars of the latest image in order of detection; stop the loop first.

        Raises BadAnswerError if the list is incomplete.
        """
        detected = int(self.client.telemetry("DetectionSummary")["NumStarsDetected"])
        identified = int(self.client.telemetry("NumIdStars")["numIdStars"])
        positions = self._records("StarPositions", detected)
        records = self._records("HipparcosNumber", identified)
        names = {number: int(record["Hipparcos"]) for number, record in records.items()}
        return [
            Star(
                number=number,
                x_px=float(record["X_Coordinate"]),
                y_px=float(record["Y_Coordinate"]),
                x_undistorted_px=float(record["X_CorrectedCoordinate"]),
                y_undistorted_px=float(record["Y_CorrectedCoordinate"]),
                pixels=int(record["Size"]),
                intensity=int(record["Intensity"]),
                hipparcos=name if name is not None and name < FIRST_BODY else None,
                body=name - FIRST_BODY if name is not None and name >= FIRST_BODY else None,
            )
            for number, record in positions.items()
            for name in (names.get(number),)
        ]

    def phase_times(self) -> dict[str, float]:
        """Latest duration of each phase in ms.

        Keys: idle, discard, capture, transfer, detect, match, attitude, loop_total.
        """
        values = self.client.telemetry("PhaseTimes")
        names = {name: name.lower() for name in values} | {"LoopTotal": "loop_total"}
        return {names[name]: int(value) / 1000.0 for name, value in values.items()}

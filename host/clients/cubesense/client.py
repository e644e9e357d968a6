"""CubeSense for programs: Sun and nadir directions, settings, supply, through any client.

CubeSpace family with two cameras, interface generation 2, with this project's extensions. Axes of
each camera: x right, y down, z out of the lens. Pixel coordinates count from the middle of the
first pixel.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.interface.cubesense.codes import Camera, CaptureResult, Sram
from cubestack.firmware_model.interface.cubesense.telecommands import DISTORTION_TERMS
from cubestack.firmware_model.interface.cubesense.telemetry import RESULTS, SCHEDULES
from cubestack.host.clients.contract import POLL_PERIOD_S, Columns, DeviceClient, Progress
from cubestack.host.clients.cubesense.download import download_image, picture_of
from cubestack.host.errors import BadAnswerError, NoAnswerError

#: Time-out of a capture; a new lens is computed first, in about 1 s.
CAPTURE_TIMEOUT_S = 3.0

#: Time-out of a detection after its capture (assumed). The longest takes 14 s: a nadir image over
#: the link of FPGAs with one search each.
DETECT_TIMEOUT_S = 20.0


def direction(alpha_deg: float, beta_deg: float) -> NDArray[np.float64]:
    """Unit vector (3,) in camera axes of a measurement's two angles.

    The field angle is their root sum of squares, in the direction (alpha, beta).
    """
    theta = math.radians(math.hypot(alpha_deg, beta_deg))
    phi = math.atan2(beta_deg, alpha_deg)
    return np.array(
        [math.sin(theta) * math.cos(phi), math.sin(theta) * math.sin(phi), math.cos(theta)]
    )


@dataclass(frozen=True)
class Measurement:
    """A camera's measurement."""

    camera: Camera  #: the camera
    #: alpha_deg, beta_deg: parts of the field angle along x and y; valid if ``detected``
    alpha_deg: float
    beta_deg: float
    capture: CaptureResult  #: result of the capture
    detect: codes.DetectResult  #: result of the detection

    @property
    def detected(self) -> bool:
        return self.detect is codes.DetectResult.SUCCESS

    @property
    def pending(self) -> bool:
        """Whether the node is still processing."""
        return self.capture is CaptureResult.PENDING or self.detect is codes.DetectResult.PENDING

    @property
    def vector(self) -> NDArray[np.float64]:
        """Unit vector (3,) in camera axes."""
        return direction(self.alpha_deg, self.beta_deg)


@dataclass(frozen=True)
class DirectionQuality:
    """Quality of a camera's latest measurement."""

    sigma_deg: tuple[float, float]  #: standard deviations of alpha and beta; 0 if unknown
    rms_px: float  #: root mean square distance of the edges from the Earth's circle, undistorted
    found: int  #: number of edges found, or of Sun pixels
    reason: codes.Reason  #: why the detection ended as it did


@dataclass(frozen=True)
class CameraSettings:
    """Exposure in units of two line times (127 us), gain, and gains of the two colours."""

    exposure: int
    gain: int = 0
    blue_gain: int = 0x80
    red_gain: int = 0x80


@dataclass(frozen=True)
class Mask:
    """A rectangle of pixels, ends included."""

    x_min: int
    x_max: int
    y_min: int
    y_max: int


@dataclass(frozen=True)
class Power:
    """Supply currents in mA, and each memory's over-current flag."""

    current_3v3_ma: float
    current_sram_ma: tuple[float, float]
    current_5v_ma: float
    over_current: tuple[bool, bool]


#: Value of an area without a mask.
_NO_MASK = Mask(0, 0, 0, 0)


class CubeSense(DeviceClient):
    """A CubeSense behind a client; methods raise the client's errors and those named."""

    picture_sources = tuple(sram.name.lower() for sram in Sram)

    def picture(
        self, source: str | None = None, progress: Progress | None = None
    ) -> NDArray[np.uint8]:
        """The image (480, 640) in memory ``source``; default: the Sun camera's, sram1."""
        sram = Sram[(source or Sram.SRAM1.name).upper()]
        return picture_of(download_image(self.client, sram, codes.ImageSize.SIDE_1024, progress))

    def capture_and_detect(self, camera: Camera, sram: Sram | None = None) -> Measurement:
        """Capture into ``sram`` (default: the camera's own) and detect.

        Returns the measurement, which may be a failure. Raises NoAnswerError if the result stays
        pending.
        """
        self.client.command("CaptureAndDetect", Camera=camera, Sram=_own(camera, sram))
        return self.wait_measured(camera)

    def capture(self, camera: Camera, sram: Sram | None = None) -> CaptureResult:
        """Capture into ``sram`` (default: the camera's own); returns the result."""
        self.client.command(
            "CaptureOnly", Camera=camera, Sram=_own(camera, sram), Location=codes.ImageLocation.TOP
        )
        return self._wait_captured(camera).capture

    def result(self, camera: Camera) -> Measurement:
        return self._measurement(camera, RESULTS[camera])

    def latest(self) -> Columns:
        columns: Columns = {"uptime_s": self.uptime_s()}
        for camera in Camera:
            found, name = self.result(camera), camera.name.lower()
            columns |= {
                f"{name}_alpha_deg": found.alpha_deg if found.detected else None,
                f"{name}_beta_deg": found.beta_deg if found.detected else None,
                f"{name}_capture": found.capture.name,
                f"{name}_detect": found.detect.name,
            }
        return columns

    def observe(self) -> None:
        """Capture with the Sun camera, then with the nadir camera, and detect in both images."""
        for camera in Camera:
            self.capture_and_detect(camera)

    def summary(self, latest: Columns) -> str:
        """Of each camera: the direction, or why there is none."""
        return "; ".join(_described(camera, latest) for camera in Camera)

    def result_then_schedule(self, camera: Camera, sram: Sram | None = None) -> Measurement:
        """A camera's latest measurement; reading it starts the next one, into ``sram``."""
        wanted = (camera, _own(camera, sram))
        identifier = next(key for key, target in SCHEDULES.items() if target == wanted)
        return self._measurement(camera, identifier)

    def wait_measured(self, camera: Camera) -> Measurement:
        """Poll until a camera's measurement is done; raises NoAnswerError if it stays pending.

        A scheduled measurement may already be running.
        """
        found = self._wait_captured(camera)
        for _ in range(math.ceil(DETECT_TIMEOUT_S / POLL_PERIOD_S)):
            if not found.pending:
                return found
            self.client.pause(POLL_PERIOD_S)
            found = self.result(camera)
        raise NoAnswerError(
            f"detection of the {Camera(camera).name} camera still pending "
            f"after {DETECT_TIMEOUT_S:g} s"
        )

    def set_threshold(self, camera: Camera, threshold: int) -> None:
        self.client.command(f"DetectionThreshold{camera + 1}", Threshold=threshold)

    def set_auto_adjust(self, camera: Camera, enabled: bool) -> None:
        self.client.command(f"AutoAdjust{camera + 1}", Enabled=int(enabled))

    def set_camera(self, camera: Camera, settings: CameraSettings) -> None:
        self.client.command(
            f"CameraSettings{camera + 1}",
            Exposure=settings.exposure,
            Gain=settings.gain,
            BlueGain=settings.blue_gain,
            RedGain=settings.red_gain,
        )

    def set_boresight(self, camera: Camera, x_px: float, y_px: float) -> None:
        """Set the pixel of a camera's optical axis."""
        self.client.command(f"Boresight{camera + 1}", X=x_px, Y=y_px)

    def set_distortion(self, camera: Camera, factors: Sequence[float]) -> None:
        """Set r_d = sum of factors[k] r_u^k, radii in px; the factors carry about 4 digits.

        Raises ValueError for another number of factors or one beyond +-32767.
        """
        if len(factors) != DISTORTION_TERMS:
            raise ValueError(f"a distortion has {DISTORTION_TERMS} factors, not {len(factors)}")
        parameters: dict[str, int] = {}
        for power, factor in enumerate(factors):
            mantissa, exponent = codes.split_coefficient(factor)
            parameters |= {f"Mantissa{power}": mantissa, f"Exponent{power}": exponent}
        self.client.command(f"Distortion{camera + 1}", **parameters)

    def set_mask(self, camera: Camera, area: int, mask: Mask | None) -> None:
        """Set ``mask`` as area 1 to 5 of a camera that detection ignores; None removes it."""
        limits = mask or _NO_MASK
        self.client.command(
            f"Mask{camera + 1}",
            Area=area,
            XMin=limits.x_min,
            XMax=limits.x_max,
            YMin=limits.y_min,
            YMax=limits.y_max,
        )

    def masks(self, camera: Camera) -> list[Mask | None]:
        """A camera's five masked areas; None for an unused one."""
        values = self.client.telemetry(f"Masks{camera + 1}")
        areas = [
            Mask(*(int(values[f"{name}{area}"]) for name in ("XMin", "XMax", "YMin", "YMax")))
            for area in range(1, codes.MASK_AREAS + 1)
        ]
        return [None if area == _NO_MASK else area for area in areas]

    def threshold(self, camera: Camera) -> int:
        return int(self.client.telemetry("Configuration")[f"Threshold{camera + 1}"])

    def auto_adjust(self, camera: Camera) -> bool:
        """Whether a camera's automatic exposure and gain are on."""
        return bool(self.client.telemetry("Configuration")[f"AutoAdjust{camera + 1}"])

    def camera(self, camera: Camera) -> CameraSettings:
        values = self.client.telemetry("Configuration")
        names = ("Exposure", "Gain", "BlueGain", "RedGain")
        return CameraSettings(*(int(values[f"{name}{camera + 1}"]) for name in names))

    def power(self) -> Power:
        values = self.client.telemetry("Power")
        return Power(
            current_3v3_ma=float(values["Current3V3"]),
            current_sram_ma=(float(values["CurrentSram1"]), float(values["CurrentSram2"])),
            current_5v_ma=float(values["Current5V"]),
            over_current=(bool(values["OverCurrent1"]), bool(values["OverCurrent2"])),
        )

    def clear_over_current(self, selection: codes.SramSelection = codes.SramSelection.BOTH) -> None:
        """Clear over-current flags; the node then switches those memories on again."""
        self.client.command("ClearOverCurrent", Selection=selection)

    def reset(self, target: codes.ResetTarget) -> None:
        self.client.command("Reset", Target=target)

    def uptime_s(self) -> float:
        """Time since the node started; it wraps after 65536 s."""
        values = self.client.telemetry("Identification")
        return int(values["RuntimeSeconds"]) + int(values["RuntimeMilliseconds"]) / 1000.0

    def serial_number(self) -> str:
        """The node's serial number; raises BadAnswerError if it is not ASCII."""
        value = self.client.telemetry("SerialNumber")["SerialNumber"]
        assert isinstance(value, bytes)
        try:
            return value.rstrip(b"\0").decode("ascii")
        except UnicodeDecodeError:
            raise BadAnswerError(
                f"telemetry SerialNumber: {value.hex()} is no ASCII text"
            ) from None

    def phase_times(self, camera: Camera) -> dict[str, float]:
        """Times of a camera's latest measurement in ms: wait, store, search, centroid, total."""
        values = self.client.telemetry(f"PhaseTimes{camera + 1}")
        return {name.lower(): int(value) / 1000.0 for name, value in values.items()}

    def details(self, camera: Camera) -> dict[str, Value]:
        return self.client.telemetry(f"Details{camera + 1}")

    def quality(self, camera: Camera) -> DirectionQuality:
        """Quality of a camera's latest measurement; zeros in profile ``published``.

        Raises BadAnswerError for an unknown reason.
        """
        values = self.client.telemetry(f"Quality{camera + 1}")
        try:
            reason = codes.Reason(int(values["Reason"]))
        except ValueError as error:
            raise BadAnswerError(f"telemetry Quality{camera + 1}: {error}") from None
        return DirectionQuality(
            (float(values["SigmaAlpha"]), float(values["SigmaBeta"])),
            float(values["Rms"]),
            int(values["Found"]),
            reason,
        )

    def edges(self) -> NDArray[np.float64]:
        """Pixels (n, 2), column and row, of the edges of the latest nadir search.

        Raises BadAnswerError for more edges than both frames hold.
        """
        parts = [self.client.telemetry(f"NadirEdges{part}") for part in (1, 2)]
        count, most = int(parts[0]["Count"]), len(parts) * codes.EDGES_PER_FRAME
        if count > most:
            raise BadAnswerError(f"telemetry NadirEdges1: {count} edges, where {most} have room")
        values = {name: value for part in parts for name, value in part.items()}
        found = [[float(values[f"{axis}{n}"]) for axis in "XY"] for n in range(1, count + 1)]
        return np.array(found, np.float64).reshape(-1, 2)

    def _measurement(self, camera: Camera, identifier: int) -> Measurement:
        message = self.client.interface.telemetry(identifier)
        values = self.client.telemetry(message.name)
        try:
            capture = CaptureResult(int(values["Capture"]))
            detect = codes.DetectResult(int(values["Detect"]))
        except ValueError as error:
            raise BadAnswerError(f"telemetry {message.name}: {error}") from None
        return Measurement(camera, float(values["Alpha"]), float(values["Beta"]), capture, detect)

    def _wait_captured(self, camera: Camera) -> Measurement:
        return self.client.poll(
            lambda: self.result(camera),
            lambda found: found.capture is not CaptureResult.PENDING,
            CAPTURE_TIMEOUT_S,
            f"capture of the {Camera(camera).name} camera still pending "
            f"after {CAPTURE_TIMEOUT_S:g} s",
            POLL_PERIOD_S,
        )


def _described(camera: Camera, latest: Columns) -> str:
    name, title = camera.name.lower(), camera.name.capitalize()
    alpha, beta = latest[f"{name}_alpha_deg"], latest[f"{name}_beta_deg"]
    if alpha is not None and beta is not None:
        right, down = float(alpha), float(beta)
        sides = "left" if right < 0 else "right", "up" if down < 0 else "down"
        return f"{title} {abs(right):.2f} deg {sides[0]}, {abs(down):.2f} deg {sides[1]}"
    capture, detect = (str(latest[f"{name}_{step}"]) for step in ("capture", "detect"))
    if capture == CaptureResult.START_UP.name:
        return f"{title}: no image since power-up"
    why = detect if CaptureResult[capture].stored else capture
    return f"{title} not found: {why.lower().replace('_', ' ')}"


def _own(camera: Camera, sram: Sram | None) -> Sram:
    """``sram``, or the camera's own."""
    return Sram(camera) if sram is None else sram

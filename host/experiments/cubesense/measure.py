"""Measure directions with CubeSense's sun and nadir sensors end to end.

Each frame gives one result of each sensor, at a random phase of its camera.
Without --scene every result has a random pose of its own: the sun sensor's with
the Sun anywhere within --sun-angle, the nadir sensor's with the Earth's centre
anywhere within --tilt, lit from behind the satellite.

examples:
  cubestack measure cubesense --frames 20
  cubestack measure cubesense --sensor nadir --frames 500 --json > nadir.jsonl
  cubestack measure cubesense --scene earth.toml --json
  cubestack measure cubesense --memory other     through the link of the FPGAs
  cubestack measure cubesense --sensor nadir --hazard clouds --hazard terminator=110
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np

from cubestack.emulator.boards.cubesense.board import CubeSenseBoard
from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene.earth_sun import CameraTarget, EarthSunScene, SensorTruth
from cubestack.firmware_model.interface.cubesense.codes import Camera, NadirSearch, Sram
from cubestack.firmware_model.values import choice, number, positive, whole
from cubestack.host.clients.cubesense.client import CubeSense, Measurement, direction
from cubestack.host.devices.experiment import Experiment, Mark, Result
from cubestack.host.emulation.emulated import EmulatedDevice
from cubestack.host.experiments import hazard_options as hazards
from cubestack.host.experiments.opener import MeasureOptions, Opener
from cubestack.host.options import file_option, option_string, switch

CubeSenseOpener: TypeAlias = "Opener[CubeSenseBoard, CubeSense]"

#: Names of --search.
SEARCHES = {
    "lines": NadirSearch.LINES,
    "samples": NadirSearch.AROUND_SAMPLES,
    "stepping": NadirSearch.AROUND_SAMPLES_STEPPING,
}

FRAME_S = 525 * 858 / 13.5e6
"""A camera's frame time: captures start at a random phase of it."""

#: Options of the random pose.
GOAL_DEG, SUN_WIDE_DEG, SUN_WIDE_GOAL_DEG = 0.2, 45.0, 2.0
"""Accuracy that the thesis aimed at (sections 7.1 and 7.2), and for a Sun beyond an angle."""

POSE = ("tilt", "sun_angle", "altitude", "bloom", "no_noise", "hazard")


@dataclass(frozen=True, kw_only=True)
class CubeSenseOptions(MeasureOptions):
    """Options of `cubestack measure cubesense`."""

    scene: Any = file_option(None, "TOML scene; default: random poses")
    frames: int = whole(1, "results of each sensor (default 1)", 1)
    sensor: str = choice("both", "default: both", ("both", "sun", "nadir"))
    memory: str = choice(
        "own",
        "SRAM that stores the images: the camera's own (default), or the other half's",
        ("own", "other"),
    )
    search: str = choice(
        "lines",
        "how edges are searched: along lines (published); around samples, by halves or "
        "stepping from pixel to pixel, with FPGAs that let the processor choose addresses",
        tuple(SEARCHES),
    )
    tilt: float | None = number(None, "random pose: largest tilt to nadir (30)", 0, 180, "deg")
    sun_angle: float | None = number(
        None, "random pose: largest angle to the Sun (90)", 0, 180, "deg"
    )
    altitude: float | None = positive(None, "random pose: altitude (750)", unit="km")
    bloom: float | None = positive(None, "random pose: radius of the Sun's image (7)", unit="px")
    no_noise: bool = switch("random pose: ideal cameras")
    hazard: tuple[hazards.Asked, ...] = hazards.hazard_option()

    def check(self) -> None:
        """Options for random poses exclude --scene; a search reads the camera's own memory."""
        hazards.check(self.hazard, earth=True)
        if self.scene is not None and self.given(*POSE):
            names = ", ".join(map(option_string, POSE))
            raise ValueError(f"{names} belong to the random poses; a scene file has keys for them")
        if self.search != "lines" and self.memory == "other":
            raise ValueError(
                f"--search {self.search} reads a camera's own SRAM: leave --memory other out"
            )

    @property
    def sensors(self) -> list[Camera]:
        return list(Camera) if self.sensor == "both" else [Camera[self.sensor.upper()]]


@dataclass(frozen=True)
class SensorResult(Result):
    """Attributes are those of the JSON output; angles in degrees, None where nothing was found."""

    sensor: str  #: "sun" or "nadir"
    detected: bool  #: whether the angles are valid
    #: alpha_deg, beta_deg: measured angles along the picture's rows and columns
    alpha_deg: float | None
    beta_deg: float | None
    #: truth_alpha_deg, truth_beta_deg: true angles
    truth_alpha_deg: float | None
    truth_beta_deg: float | None
    error_deg: float | None  #: angle between the measured and the true direction
    #: error up to which a direction is right: the thesis' goals, sections 7.1 and 7.2, by sensor
    #: and, for the Sun, by its angle to the boresight; three times what the device claims if that
    #: is more
    tolerance_deg: float
    right: bool  #: whether the direction is right, or rightly nothing was found
    #: standard deviations of alpha and beta that the device claims; None where it claims none
    sigma_deg: tuple[float, float] | None
    reason: str  #: why the detection ended as it did; "none" in profile ``published``
    edges: int | None  #: edges that the nadir sensor's fit used; None for the sun sensor
    sun_pixels: int | None  #: pixels of the sun sensor's mean; None for the nadir sensor
    pixels_read: int  #: pixels that the processor read from the FPGA
    #: capture, detect: result codes by name
    capture: str
    detect: str
    phase_ms: dict[str, float]  #: virtual times: wait, store, search, centroid, total
    wall_ms: float  #: wall time of the measurement

    @property
    def solved(self) -> bool:
        return self.detected


def _told(results: Sequence[SensorResult]) -> str:
    """Number of detections; their errors and times."""
    errors = [result.error_deg for result in results if result.error_deg is not None]
    times = [result.phase_ms["total"] for result in results if result.detected]
    right = sum(result.right for result in results)
    text = f"{len(times)} of {len(results)} detected, {right} right"
    if not errors:
        return text
    return (
        f"{text}; error: mean {np.mean(errors):.3f}, "
        f"95th percentile {np.percentile(errors, 95):.3f} deg; time {np.mean(times):.1f} ms, "
        f"at most {max(times):.1f}"
    )


def _claimed(results: Sequence[SensorResult]) -> str | None:
    """Errors against the claimed standard deviations, and the longest step of each kind; None
    without claims.
    """
    ratios = np.array([ratio for result in results for ratio in _ratios(result)])
    if not len(ratios):
        return None
    steps = {name: max(result.phase_ms[name] for result in results) for name in results[0].phase_ms}
    longest = max((name for name in steps if name != "total"), key=steps.__getitem__)
    inside = [100 * float(np.mean(ratios < sigmas)) for sigmas in (1, 3)]
    return (
        f"{inside[0]:.0f} % inside of 1 sigma, {inside[1]:.1f} % of 3; "
        f"longest step: {longest}, {steps[longest]:.1f} ms"
    )


def _ratios(result: SensorResult) -> list[float]:
    if result.sigma_deg is None or result.error_deg is None:
        return []
    pairs = zip(
        (result.alpha_deg, result.beta_deg),
        (result.truth_alpha_deg, result.truth_beta_deg),
        result.sigma_deg,
        strict=True,
    )
    return [
        abs(found - truth) / sigma
        for found, truth, sigma in pairs
        if found is not None and truth is not None
    ]


class _Experiment(Experiment["CubeSenseOpener", CubeSenseOptions, SensorResult]):
    options = CubeSenseOptions
    description = __doc__
    marks = (
        Mark("error_deg", GOAL_DEG, "goal: section 8"),
        Mark("error_deg", 1.0, "Sun, 40 to 60 deg: section 7.2"),
        Mark("error_deg", 1.85, "Sun, 60 to 90 deg: section 7.2"),
    )
    title = "directions over the serial line, beside the truth; degrees"
    columns = (
        "sensor",
        "alpha",
        "truth",
        "beta",
        "truth",
        "error",
        "sigma",
        "points",
        "ms",
        "result",
    )
    decides = ("mcu_addressing",)

    def count(self, options: CubeSenseOptions) -> int:
        return options.frames * len(options.sensors)

    def run(self, opened: CubeSenseOpener, options: CubeSenseOptions) -> Iterator[SensorResult]:
        rng = np.random.default_rng(options.seed)
        search = SEARCHES[options.search]
        sampling = search is not NadirSearch.LINES
        given = None if options.scene is None else opened.device.scene(options.scene)
        with opened(
            given or random_view(options, options.sensors[0], rng),
            seed=options.seed,
            faults=options.faults,
            mcu_addressing=sampling,
        ) as emulated:
            if sampling:
                emulated.client.client.command("SetNadirSearch", Search=search)
            for _ in range(options.frames):
                for sensor in options.sensors:
                    emulated.scene = given or random_view(options, sensor, rng)
                    emulated.client.client.pause(float(rng.uniform(0, FRAME_S)))
                    sram = Sram(sensor if options.memory == "own" else 1 - sensor)
                    yield measure_once(emulated, sensor, sram, rated=opened.rates)

    def row(self, number: int, result: SensorResult) -> tuple[str, ...]:
        return (
            result.sensor,
            _degrees(result.alpha_deg),
            _degrees(result.truth_alpha_deg),
            _degrees(result.beta_deg),
            _degrees(result.truth_beta_deg),
            _degrees(result.error_deg, 3),
            "-" if result.sigma_deg is None else f"{np.hypot(*result.sigma_deg):.3f}",
            str(result.sun_pixels if result.edges is None else result.edges),
            f"{result.phase_ms['total']:.1f}",
            _ending(result),
        )

    def summarise(self, results: Sequence[SensorResult], wall_s: float) -> Iterator[str]:
        for sensor in ("sun", "nadir"):
            own = [result for result in results if result.sensor == sensor]
            if own:
                yield f"{sensor}: {_told(own)}"
                if claimed := _claimed(own):
                    yield f"{sensor}: {claimed}"
        yield f"{wall_s:.1f} s wall time"

    def succeeded(self, results: Sequence[SensorResult]) -> bool:
        """Whether something was found, or rightly nothing."""
        return any(result.detected or result.right for result in results)


def _ending(result: SensorResult) -> str:
    """Its result, and why nothing was found."""
    if not result.capture.startswith("stored"):
        return result.capture
    told = not result.detected and result.reason != "none"
    return f"{result.detect}: {result.reason}" if told else result.detect


def _degrees(value: float | None, digits: int = 2) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def random_view(
    options: CubeSenseOptions, sensor: Camera, rng: np.random.Generator
) -> EarthSunView:
    """A pose for one sensor: its target within the given angle, and the Earth at noon."""
    reach = _or(options.sun_angle, 90.0) if sensor is Camera.SUN else _or(options.tilt, 30.0)
    radius, towards = reach * np.sqrt(rng.random()), 2 * np.pi * rng.random()
    angles = (float(radius * np.cos(towards)), float(radius * np.sin(towards)))
    condition = FisheyeCondition(
        bloom_px=_or(options.bloom, 7.0),
        noise=not options.no_noise,
        seed=int(rng.integers(1 << 31)),
    )
    view = view_of(sensor, angles, condition, _or(options.altitude, 750.0))
    return hazards.around_earth(view, CameraTarget(sensor), options.hazard, rng)


def view_of(
    sensor: Camera,
    angles: tuple[float, float],
    condition: FisheyeCondition,
    altitude_km: float = 750.0,
) -> EarthSunView:
    """A sensor's target at its angles alpha and beta, and the Earth at noon."""
    others: dict[str, Any] = {"altitude_km": altitude_km, "seed": condition.seed}
    if sensor is Camera.SUN:
        scene = EarthSunScene.facing(sun_deg=angles, **others)
        return EarthSunView(replace(scene, nadir=-np.asarray(scene.sun)), condition)
    scene = EarthSunScene.facing(nadir_deg=angles, **others)
    return EarthSunView(replace(scene, sun=-np.asarray(scene.nadir)), condition)


def _or(given: float | None, default: float) -> float:
    return default if given is None else given


def measure_once(
    emulated: EmulatedDevice[CubeSenseBoard, CubeSense],
    sensor: Camera,
    sram: Sram,
    *,
    rated: bool = False,
) -> SensorResult:
    """One measurement into ``sram``, beside the truth; ``rated``: with the firmware's quality
    telemetry.
    """
    cubesense = emulated.client
    started = time.perf_counter()
    measured = cubesense.capture_and_detect(sensor, sram)
    wall_ms = 1000 * (time.perf_counter() - started)
    truth = emulated.board.truth(sensor) if measured.capture.stored else None
    visible = truth if truth is not None and truth.visible else None
    error_deg = None if visible is None else _error_deg(measured, visible)
    nothing = measured.capture.stored and visible is None and not measured.detected
    details = cubesense.details(sensor)
    points = int(details["Points"])
    quality = cubesense.quality(sensor) if rated else None
    claimed = quality.sigma_deg if quality and measured.detected else None
    tolerance_deg = _tolerance_deg(sensor, visible, claimed)
    return SensorResult(
        sensor=sensor.name.lower(),
        detected=measured.detected,
        alpha_deg=measured.alpha_deg if measured.detected else None,
        beta_deg=measured.beta_deg if measured.detected else None,
        truth_alpha_deg=None if visible is None else visible.alpha_deg,
        truth_beta_deg=None if visible is None else visible.beta_deg,
        error_deg=error_deg,
        tolerance_deg=tolerance_deg,
        right=nothing if error_deg is None else error_deg <= tolerance_deg,
        sigma_deg=claimed,
        reason=quality.reason.name.lower() if quality else "none",
        edges=points if sensor is Camera.NADIR else None,
        sun_pixels=points if sensor is Camera.SUN else None,
        pixels_read=int(details["PixelsRead"]),
        capture=measured.capture.name.lower(),
        detect=measured.detect.name.lower(),
        phase_ms=cubesense.phase_times(sensor),
        wall_ms=wall_ms,
    )


def is_right(
    emulated: EmulatedDevice[CubeSenseBoard, CubeSense], sensor: Camera, measured: Measurement
) -> bool:
    truth = emulated.board.truth(sensor) if measured.capture.stored else None
    if truth is None or not truth.visible:
        return False
    error_deg = _error_deg(measured, truth)
    return error_deg is not None and error_deg <= _tolerance_deg(sensor, truth, None)


def _tolerance_deg(
    sensor: Camera, truth: SensorTruth | None, claimed: tuple[float, float] | None
) -> float:
    """Goals of sections 7.1 and 7.2, or three claimed standard deviations."""
    wide = truth is not None and float(truth.vector[2]) < np.cos(np.radians(SUN_WIDE_DEG))
    goal = SUN_WIDE_GOAL_DEG if sensor is Camera.SUN and wide else GOAL_DEG
    return max(goal, 3 * max(claimed or (0.0,)))


def _error_deg(measured: Measurement, truth: SensorTruth) -> float | None:
    if not measured.detected:
        return None
    vector = direction(measured.alpha_deg, measured.beta_deg)
    # Precise for small angles, unlike an arc cosine.
    sine = float(np.linalg.norm(np.cross(vector, truth.vector)))
    return float(np.degrees(np.arctan2(sine, float(vector @ truth.vector))))


EXPERIMENT = _Experiment()

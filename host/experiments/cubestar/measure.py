"""Measure attitudes of CubeStar end to end: scene, camera, FPGA, firmware, host.

Every frame is captured and processed by the emulated device; the host sees only
what comes back over the serial line. Only this command has the truth; it prints
it beside the result.

The camera sees more stars than the onboard list has, so the published detection
threshold of 6 fills pictures with stars that have no name. Where all stars are in
view, the threshold is therefore searched first, with telecommands alone: over a few
random skies, or in the picture of --image. --mag-limit 3.8 cuts the sky at the list's
own limit and leaves the threshold as it is. So do --scene and --faults, for their
times, and profile extended, which takes a threshold from each picture.

examples:
  cubestack measure cubestar --frames 20                      lost in space
  cubestack measure cubestar --threshold 13 --min-right 90    exit status 1 below 90 % right
  cubestack measure cubestar --frames 200 --mag-limit 3.8 --json > frames.jsonl
  cubestack measure cubestar --mode assisted --hint-error 5   rough boresight
  cubestack measure cubestar --image sky.jpg --crop 0,256 --camera camera.json
  cubestack measure cubestar --mag-limit 3.8 --layout 2       one SRAM for FPGA and processor
  cubestack measure cubestar --profile extended --set gyro=on --turning 0.3    the body rate too
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.boards.cubestar.board import CubeStarBoard
from cubestack.emulator.camera.common.view import SkyView
from cubestack.emulator.camera.mlx75412.lens import CONDITION
from cubestack.emulator.scene.hazards.moon import Moon
from cubestack.emulator.scene.hazards.planets import Planets
from cubestack.emulator.scene.sky import PictureScene, SkyScene
from cubestack.firmware_model.formats.untrusted import read_json
from cubestack.firmware_model.interface.cubestar import INTERFACE, IdMode, MatchMode, TaskStatus
from cubestack.firmware_model.interface.cubestar.codes import Reason
from cubestack.firmware_model.interface.cubestar.extensions import MOST_BODIES
from cubestack.firmware_model.values import REQUIRED, ValueKind, choice, declare, number, whole
from cubestack.host.calibration.camera import load_camera
from cubestack.host.clients.cubestar.client import CubeStar, ListedBody
from cubestack.host.clients.cubestar.operator import calibrate, find_threshold
from cubestack.host.devices.experiment import Mark
from cubestack.host.emulation.emulated import EmulatedDevice
from cubestack.host.errors import CameraFileError
from cubestack.host.experiments import attitude as attitudes
from cubestack.host.experiments import hazard_options as hazards
from cubestack.host.experiments.opener import Opener
from cubestack.host.options import corner, path_option

CubeStarOpener: TypeAlias = "Opener[CubeStarBoard, CubeStar]"
CubeStarEmulated: TypeAlias = "EmulatedDevice[CubeStarBoard, CubeStar]"

#: Names of --mode for the firmware's modes.
MODE_NAMES = {
    MatchMode.LOST_IN_SPACE: "lis",
    MatchMode.ASSISTED: "assisted",
    MatchMode.TRACKING: "tracking",
}

UNIT_TOLERANCE = 1e-3
FEWEST_STARS, MOST_STARS = 3, 20  # needed for an attitude; the largest in a search
SEARCH = "search"
SKIES = 5
"""Random skies in a threshold search."""

START_S = 0.02
"""Start-up time in s of own firmware, which ignores its ports until then."""

EPHEMERIS_RAD = 5e-5
"""Error of the listed planets and Moon, 10 arcsec: of an almanac's short series."""

EPHEMERIS = 211  # stream of their errors
LISTED_MIN = 60
UNLISTED = {"Sun", "Uranus", "Neptune"}  # not seen among the stars

APART_S = 1.0
"""Time in s between two images of a sky, for the stellar gyro."""

EXPOSED_S = 0.3
"""Approximate time in s from command to exposure; it matters only for fast motion."""

LIMITS_MS = {"detect": 220.0, "match": 250.0, "attitude": 30.0}
"""The 1 Hz loop leaves 500 ms for all steps (section 5.3.6; with idle time and capture)."""

_DN = whole(REQUIRED, "", 1, 255, "DN")
THRESHOLD = ValueKind(
    "threshold",
    f"{_DN.limits}, or {SEARCH}",
    lambda given: given if given == SEARCH else _DN.read(given),
    lambda text: text if text == SEARCH else _DN.parse(text),
)


@dataclass(frozen=True, kw_only=True)
class CubeStarOptions(attitudes.SkyOptions):
    """Options of `cubestack measure cubestar`."""

    mode: str = choice(
        "lis", "lost in space (default), assisted match, or tracking", tuple(MODE_NAMES.values())
    )
    hint_error: float = number(
        0.0,
        "largest error of the hint (assisted) or of the last attitude (tracking)",
        0,
        180,
        "deg",
    )
    threshold: int | str | None = declare(
        THRESHOLD,
        None,
        "detection threshold, or 'search' (default where all stars are in view, without --scene "
        "and --faults)",
        metavar="DN",
    )
    turning: float = number(0.0, "body rate about a random axis", 0, 10, "deg/s")
    crop: tuple[int, int] = corner((0, 0), "with --image: left upper corner of the 1024 x 512 part")
    camera: Path | None = path_option(
        None, "with --image: JSON with the camera's f_px, cx_px, cy_px, k1, k2, p1, p2"
    )

    def check(self) -> None:
        """Options for images need --image; options for random skies exclude --scene and --image."""
        if self.image is None and self.given("camera", "crop"):
            raise ValueError("--crop and --camera belong to --image")
        hazards.check(self.hazard)
        if not self.is_random and self.given(
            "mag_limit", "false_stars", "no_noise", "hazard", "turning"
        ):
            raise ValueError(
                "--mag-limit, --false-stars, --no-noise, --hazard and --turning belong to the "
                "random sky; a scene file has the keys mag_limit, false_stars, noise, hazards and "
                "rate_deg_s"
            )

    @property
    def searches(self) -> bool:
        """Whether to search a threshold before the first frame, if the firmware needs one."""
        if self.threshold is not None:
            return self.threshold == SEARCH
        uncut = self.is_random and self.mag_limit is None and self.faults is None
        return uncut or self.image is not None


@dataclass(frozen=True)
class CubeStarResult(attitudes.AttitudeResult):
    """Attributes are those of the JSON output."""

    threshold: int  #: of detection, in DN
    searched: bool  #: whether it was searched first, with some skies or the image
    #: rate_deg_s, rate_sigma_deg_s, rate_error_deg_s: body rate of switch gyro about the camera's
    #: axes, claimed standard deviations and errors; None without
    rate_deg_s: list[float] | None = None
    rate_sigma_deg_s: list[float] | None = None
    rate_error_deg_s: list[float] | None = None
    #: planets, disc: of switch bodies, planets identified and what the Moon's place shows; None
    #: without
    planets: int | None = None
    disc: str | None = None


class _Experiment(attitudes.AttitudeExperiment["CubeStarOpener", CubeStarOptions, CubeStarResult]):
    options = CubeStarOptions
    limits_ms = LIMITS_MS
    description = __doc__
    marks = (
        Mark("error_cross_deg", 0.0083, "night sky, 1 sigma: table 6.1"),
        Mark("error_cross_deg", 0.004, "worst without noise: section 4.4"),
        Mark("error_roll_deg", 0.0203, "night sky, 1 sigma: table 6.1"),
    )

    def run(self, opened: CubeStarOpener, options: CubeStarOptions) -> Iterator[CubeStarResult]:
        rng = np.random.default_rng(options.seed)
        camera, picture_truth = None, None
        if options.camera is not None:
            camera = load_camera(options.camera).cropped(*options.crop)
        scene = options.scene
        if options.image is not None:
            scene = PictureScene(options.image, crop=options.crop)
            picture_truth = _picture_truth(options.image, options.camera)
        elif options.is_random:
            scene = _view(options, rng)
        with opened(scene, seed=options.seed, faults=options.faults) as emulated:
            wait_started(emulated)
            if camera is not None:
                emulated.client.configure(calibrate(camera).settings)
            searches = options.searches and not _adapts(opened)
            gyro = _has(opened, "gyro") and options.mode == "lis"
            bodies = _has(opened, "bodies")
            listing = np.random.default_rng([options.seed, EPHEMERIS])
            threshold = _threshold(emulated, options, searches)
            for number in range(options.frames):
                if number and options.is_random:
                    emulated.scene = _view(options, rng, emulated.time_s + EXPOSED_S)
                if bodies:
                    list_bodies(emulated, listing)
                if options.is_random and gyro:
                    _earlier_image(emulated)
                found = _measure(
                    emulated, options, picture_truth, rng, threshold, searches, opened.rates
                )
                if bodies:
                    found = replace(found, **_seen(emulated))
                yield replace(found, **_rate(emulated)) if gyro else found

    def summarise(self, results: Sequence[CubeStarResult], wall_s: float) -> Iterator[str]:
        if any(result.searched for result in results):
            yield (
                f"detection threshold {results[0].threshold} DN, from a search, lost in space; "
                "--threshold DN sets one"
            )
        yield from super().summarise(results, wall_s)
        rates = np.array([r.rate_error_deg_s for r in results if r.rate_error_deg_s is not None])
        if len(rates):
            x, y, z = 3600 * np.sqrt(np.mean(rates**2, axis=0))
            yield (
                f"body rate in {len(rates)} of {len(results)}; root mean square error {x:.1f} and "
                f"{y:.1f} arcsec/s across, {z:.1f} about the boresight"
            )

    def advice(self, results: Sequence[CubeStarResult]) -> str:
        stars, threshold = np.median([result.centroids for result in results]), results[0].threshold
        if stars < FEWEST_STARS:
            return f"{stars:.0f} stars found: --threshold below {threshold}, or a darker sky"
        if stars >= MOST_STARS:
            return f"pictures full of stars: --threshold above {threshold}, or --threshold search"
        return "--mode assisted --hint-error 5 or --profile extended solve more"


def wait_started(emulated: CubeStarEmulated) -> None:
    if emulated.board.firmware:
        emulated.wait(START_S)


def _threshold(emulated: CubeStarEmulated, options: CubeStarOptions, searches: bool) -> int:
    """Search or set the detection threshold; returns it."""
    command, name = "setDetectionThresholds", "DetectionThreshold"
    found = None if options.threshold == SEARCH else options.threshold
    if searches:
        found = find_threshold(emulated.client, _views(emulated, options))
    elif found is not None:
        emulated.client.client.command(command, DetectionThreshold=found, StarThreshold=found)
    return int(found or INTERFACE.telecommand(command).reset_values()[name])


def _adapts(opened: CubeStarOpener) -> bool:
    """Whether the firmware raises its threshold by each image."""
    switches: Any = opened.switches
    return opened.rates and bool(switches.detection == "background")


def _has(opened: CubeStarOpener, switch: str) -> bool:
    return not opened.board.get("firmware") and getattr(opened.switches, switch) == "on"


def list_bodies(emulated: CubeStarEmulated, rng: np.random.Generator) -> None:
    """List the scene's planets and Moon at the device, as an on-board computer with an ephemeris
    does: each direction is wrong by ``EPHEMERIS_RAD``, 1 sigma in each axis."""
    scene = emulated.scene
    lights = [one for one in getattr(scene, "hazards", ()) if isinstance(one, (Planets, Moon))]
    bodies = [body for one in lights for body in one.bodies if body.name not in UNLISTED]
    for place in range(MOST_BODIES):
        there = bodies[place] if place < len(bodies) else None
        at = np.array([1.0, 0.0, 0.0]) if there is None else there.direction
        if there is not None:
            at = at + EPHEMERIS_RAD * rng.standard_normal(3)
        emulated.client.list_body(
            place,
            ListedBody(
                at,
                minutes=0 if there is None else LISTED_MIN,
                accuracy_rad=EPHEMERIS_RAD,
                radius_rad=0.0 if there is None else float(np.radians(there.radius_deg)),
            ),
        )


def _seen(emulated: CubeStarEmulated) -> dict[str, Any]:
    """Fields of what came of the listed bodies."""
    seen = emulated.client.bodies_seen()
    return {"planets": seen.named, "disc": _words(seen.disc)}


def _view(options: CubeStarOptions, rng: np.random.Generator, time_s: float = 0.0) -> SkyView:
    """A random view that turns, if it shall; ``time_s``: approximate time of its exposure."""
    more: dict[str, Any] = {}
    if options.turning:
        axis = rng.standard_normal(3)
        more["rate_deg_s"] = tuple(options.turning * axis / np.linalg.norm(axis))
    return attitudes.random_view(options, CONDITION, rng, time_s, **more)


def _earlier_image(emulated: CubeStarEmulated) -> None:
    """An image that the next one's rate can be measured against."""
    due_s = emulated.time_s + APART_S
    emulated.client.capture_and_process()
    emulated.client.client.pause(max(0.0, due_s - emulated.time_s))


def _rate(emulated: CubeStarEmulated) -> dict[str, Any]:
    """Fields of the stellar gyro's result; the truth is the scene's present rate."""
    rate, scene = emulated.client.body_rate(), emulated.scene
    if not rate.valid:
        return {}
    known = isinstance(scene, SkyScene)
    truth = scene.pose_at(emulated.board.kernel.now).rate_deg_s if known else None
    measured = np.degrees(rate.rate_rad_s)
    found: dict[str, Any] = {
        "rate_deg_s": measured.tolist(),
        "rate_sigma_deg_s": np.degrees(rate.sigmas_rad_s).tolist(),
    }
    if truth is not None:
        found["rate_error_deg_s"] = (measured - np.asarray(truth, np.float64)).tolist()
    return found


def _views(emulated: CubeStarEmulated, options: CubeStarOptions) -> Iterator[None]:
    """Views for a threshold search: random skies, or the camera's scene."""
    if not options.is_random:
        yield
        return
    scene, rng = emulated.scene, np.random.default_rng([options.seed, SKIES])
    for _ in range(SKIES):
        emulated.scene = _view(options, rng)
        yield
    emulated.scene = scene


def _picture_truth(image: Path, camera: Path | None) -> NDArray[np.float64] | None:
    """Attitude of an image, from the "images" object of its camera file, if any."""
    if camera is None:
        return None
    content = read_json(camera, CameraFileError)
    try:
        quaternion = content["images"][image.name]["quaternion_xyzw_inertial_to_camera"]
    except (KeyError, TypeError):  # a camera file may lack the image
        return None
    truth = np.array(quaternion, np.float64)
    if truth.shape != (4,) or not abs(np.linalg.norm(truth) - 1) < UNIT_TOLERANCE:
        raise CameraFileError(f"{camera}: {image.name}'s quaternion must be four of unit length")
    return truth


def _measure(
    emulated: CubeStarEmulated,
    options: CubeStarOptions,
    picture_truth: NDArray[np.float64] | None,
    rng: np.random.Generator,
    threshold: int,
    searched: bool,
    rates: bool,
) -> CubeStarResult:
    started = time.perf_counter()
    cubestar, client = emulated.client, emulated.client.client
    client.command("ClearErrorFlags")
    known = picture_truth
    if options.mode == "lis":
        client.command("setIDMode", IdMode=IdMode.LOST_IN_SPACE)
    else:
        if known is None:
            known = emulated.scene.truth(emulated.board.kernel.now)
        if known is None:
            raise ValueError(f"--mode {options.mode} needs a scene whose attitude is known")
        client.command("setIDMode", IdMode=IdMode.TRACKING)
        tracking = options.mode == "tracking"
        give_hint(
            cubestar, attitudes.rough_boresight(known, 0.0 if tracking else options.hint_error, rng)
        )
        if tracking:
            _prime_tracking(emulated, options.hint_error, rng)
    status = cubestar.capture_and_process()
    attitude = cubestar.attitude()
    solved = attitude.valid
    if picture_truth is None:
        known = emulated.board.truth()
    centroids = int(client.telemetry("DetectionSummary")["NumStarsDetected"])
    named = solved or status is TaskStatus.CALCULATION_FAILED
    wrong = count_wrong(cubestar, known) if named else 0
    phases = {name: ms for name, ms in cubestar.phase_times().items() if name != "loop_total"}
    # The flags say why a task ended.
    flags = [name for name, up in client.telemetry("ErrorFlags").items() if up]
    rated = cubestar.quality() if rates else None
    measured = attitude.quaternion if solved else None
    return CubeStarResult(
        **attitudes.compare(measured, known),
        **attitudes.claims(rated, measured, known),
        reason=None if rated is None or rated.reason is Reason.NOT_RATED else _words(rated.reason),
        centroids=centroids,
        matched=attitude.matched if solved else 0,
        wrong=wrong,
        mode=MODE_NAMES[attitude.mode] if solved else options.mode,
        phase_ms=phases,
        wall_ms=1000 * (time.perf_counter() - started),
        status=" ".join([status.name.lower(), *flags]),
        threshold=threshold,
        searched=searched,
    )


def _words(reason: IntEnum) -> str:
    return reason.name.lower().replace("_", " ")


def give_hint(cubestar: CubeStar, boresight: NDArray[np.float64]) -> None:
    """Set the device's rough boresight: an inertial vector (3,)."""
    x, y, z = boresight
    cubestar.client.command(
        "setTrackingMode",
        RightAscension=float(np.arctan2(y, x)),
        Declination=float(np.arctan2(z, np.hypot(x, y))),
    )


def _prime_tracking(
    emulated: CubeStarEmulated, offset_deg: float, rng: np.random.Generator
) -> None:
    """Have the device find an attitude at most ``offset_deg`` from the one to track."""
    scene = emulated.scene
    if not isinstance(scene, SkyScene):
        raise ValueError("--mode tracking needs a sky scene: an image has no previous frame")
    axis = rng.standard_normal(3)
    rate = offset_deg * rng.random() * axis / np.linalg.norm(axis)
    emulated.scene = scene.rotate(rate)
    emulated.client.capture_and_process()
    emulated.scene = scene
    emulated.client.client.command("ClearErrorFlags")


def count_wrong(cubestar: CubeStar, truth: NDArray[np.float64] | None) -> int | None:
    """Number of wrongly identified stars; None without a truth."""
    if truth is None:
        return None
    client = cubestar.client
    stars = {s.number: s.hipparcos for s in cubestar.stars() if s.hipparcos is not None}
    count = int(client.telemetry("DetectionSummary")["NumStarsDetected"])
    vectors: dict[int, list[Any]] = {}
    for _ in range(count):
        record = client.telemetry("BodyUnitVectors")
        vectors[int(record["StarNumber"])] = [record[f"Vb{axis}"] for axis in "XYZ"]
    return attitudes.count_wrong(list(stars.values()), [vectors[number] for number in stars], truth)


EXPERIMENT = _Experiment()

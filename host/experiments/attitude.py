"""Shared parts of measuring star trackers: random skies, hints, attitudes beside the truth.

Axes and errors: D = A_measured A_truth^T, with A the rotation from inertial to camera; the error
across is the angle between the boresights, the error about them atan2(D01 - D10, D00 + D11).
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cubestack.emulator.camera.common.view import SkyCondition, SkyView
from cubestack.emulator.scene.attitude import (
    attitude_error_deg,
    matrix_from_quaternion,
    quaternion_from_matrix,
    random_quaternion,
)
from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.values import number, whole
from cubestack.host.clients.quaternions import AttitudeQuality, pointing_deg
from cubestack.host.devices.experiment import Experiment, OpenerT, Result, Section
from cubestack.host.experiments import hazard_options as hazards
from cubestack.host.experiments.opener import MeasureOptions
from cubestack.host.experiments.rates import wilson
from cubestack.host.options import corner, file_option, path_option, switch
from cubestack.host.pictures.figures import sky_map

RIGHT_CROSS_DEG = 0.1
RIGHT_ROLL_DEG = 0.3
POOR = 0.5  # share of right results below which a hint is printed
SAME_STAR_DEG = 0.2
"""An identified star farther than this from its true position has a wrong identity."""


@dataclass(frozen=True, kw_only=True)
class SkyOptions(MeasureOptions):
    """Options of every star tracker; without scene and image each frame has a random sky."""

    scene: Any = file_option(None, "TOML scene; default: random sky", group="light")
    image: Path | None = path_option(None, "use an image file in place of the sky", group="light")
    mode: str = "lis"
    hint_error: float = number(0.0, "largest error of the hint", 0, 180, "deg")
    mag_limit: float | None = number(
        None,
        "leave out stars fainter than this; default: none that the camera can see",
        metavar="V",
    )
    false_stars: int = whole(
        0, "number of stars that are in no catalogue, at random places", 0, metavar="N"
    )
    no_noise: bool = switch("turn the sensor's noise off")
    hazard: tuple[hazards.Asked, ...] = hazards.hazard_option()
    crop: tuple[int, int] = corner(
        (0, 0), "with --image: left upper corner of the part that is seen"
    )

    @property
    def is_random(self) -> bool:
        return self.scene is None and self.image is None


def random_view(
    options: SkyOptions,
    condition: SkyCondition,
    rng: np.random.Generator,
    time_s: float = 0.0,
    **more: Any,
) -> SkyView:
    """A view of a sky at a random pose, as the options say; ``more`` are arguments of the scene.

    ``time_s`` is the approximate time of its exposure.
    """
    scene = SkyScene(
        quaternion=random_quaternion(rng),
        mag_limit=options.mag_limit,
        false_stars=options.false_stars,
        seed=int(rng.integers(1 << 31)),
        **more,
    )
    view = SkyView(scene, replace(condition, noise=not options.no_noise, seed=scene.seed))
    return hazards.with_hazards(view, options.hazard, rng, time_s)


def rough_boresight(
    truth: NDArray[np.float64], error_deg: float, rng: np.random.Generator
) -> NDArray[np.float64]:
    """A boresight (3,) at most ``error_deg`` from the true one, uniform over that cap."""
    matrix = matrix_from_quaternion(truth)
    away = np.radians(error_deg) * np.sqrt(rng.random())
    side = rng.random() * 2 * np.pi
    across = np.cos(side) * matrix[0] + np.sin(side) * matrix[1]
    return np.asarray(np.cos(away) * matrix[2] + np.sin(away) * across, np.float64)


def errors(measured: NDArray[np.floating[Any]], truth: NDArray[np.float64]) -> tuple[float, float]:
    """Errors across and about the boresight, degrees; of quaternions (4,), scalar last."""
    return attitude_error_deg(measured, truth)


def is_right(cross_deg: float, roll_deg: float) -> bool:
    return cross_deg < RIGHT_CROSS_DEG and abs(roll_deg) < RIGHT_ROLL_DEG


def compare(
    measured: NDArray[np.float64] | None, truth: NDArray[np.float64] | None
) -> dict[str, Any]:
    """Fields of an ``AttitudeResult`` from measured and true attitude; None if one is missing."""
    cross = roll = right = None
    if measured is not None and truth is not None:
        cross, roll = errors(measured, truth)
        right = is_right(cross, roll)
    elif truth is not None:
        right = False
    return {
        "solved": measured is not None,
        "right": right,
        "error_cross_deg": cross,
        "error_roll_deg": roll,
        "truth": _listed(truth),
        "quaternion": _listed(measured),
    }


def axis_errors_deg(
    measured: NDArray[np.floating[Any]], truth: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Rotation vector (3,) from reported to true camera axes, of quaternions (4,); 0 to 180 deg."""
    turn = matrix_from_quaternion(truth) @ matrix_from_quaternion(measured).T
    *axis, cosine = quaternion_from_matrix(turn)
    sine = float(np.linalg.norm(axis))
    return np.degrees(axis) * (2 * np.arctan2(sine, cosine) / sine if sine else 2.0)


def claims(
    rated: AttitudeQuality | None,
    measured: NDArray[np.float64] | None,
    truth: NDArray[np.float64] | None,
) -> dict[str, Any]:
    """Fields of an ``AttitudeResult`` with the sensor's claims and errors."""
    known = rated if rated is not None and rated.valid and measured is not None else None
    return {
        "false_alarm": None if known is None else float(known.false_alarm),
        "sigma_deg": None if known is None else np.degrees(known.sigmas_rad).tolist(),
        "error_deg": None
        if measured is None or truth is None
        else axis_errors_deg(measured, truth).tolist(),
    }


def _listed(quaternion: NDArray[np.float64] | None) -> list[float] | None:
    return None if quaternion is None else [float(part) for part in quaternion]


def count_wrong(hipparcos: Sequence[int], directions: ArrayLike, truth: NDArray[np.float64]) -> int:
    """Number of wrongly identified stars.

    Args:
        hipparcos: their Hipparcos numbers.
        directions: measured directions (n, 3), any length, in camera axes.
        truth: quaternion (4,).
    """
    if not hipparcos:
        return 0
    sky = load_sky()
    numbers = np.array(hipparcos, sky.hip.dtype)  # another type would convert the whole catalogue
    expected = sky.vectors[sky.hip.searchsorted(numbers)] @ matrix_from_quaternion(truth).T
    measured = np.asarray(directions, np.float64)
    cosines = np.sum(expected * measured, axis=1) / np.linalg.norm(measured, axis=1)
    return int(np.sum(np.degrees(np.arccos(np.clip(cosines, -1, 1))) > SAME_STAR_DEG))


@dataclass(frozen=True)
class AttitudeResult(Result):
    """Attributes are those of the JSON output; angles in degrees, None where there is no truth."""

    solved: bool  #: the measurement gave an attitude
    right: bool | None  #: it did, and the attitude is right; None without truth
    #: centroids, matched: stars found, and stars used for the attitude
    centroids: int
    matched: int
    #: identified stars with a wrong identity, whether or not they gave an attitude
    wrong: int | None
    mode: str  #: "lis", "assisted" or "tracking"
    #: error_cross_deg, error_roll_deg: across and about the boresight
    error_cross_deg: float | None
    error_roll_deg: float | None
    #: truth, quaternion: inertial to camera, scalar last; None without attitude
    truth: list[float] | None
    quaternion: list[float] | None
    reason: str | None  #: why there is no attitude, if the sensor says so, else None
    false_alarm: float | None  #: expected number of wrong confirmed attitudes; None if not rated
    #: sigma_deg, error_deg: claimed standard deviations, and errors, about the camera's axes
    sigma_deg: list[float] | None
    error_deg: list[float] | None
    phase_ms: dict[str, float]  #: virtual time of each step; wall_ms is wall time
    wall_ms: float
    status: str  #: how it ended, and names of the error flags

    @property
    def ending(self) -> str:
        return self.status


SkyOptionsT = TypeVar("SkyOptionsT", bound=SkyOptions)
AttitudeResultT = TypeVar("AttitudeResultT", bound=AttitudeResult)


class AttitudeExperiment(Experiment[OpenerT, SkyOptionsT, AttitudeResultT]):
    """Attitudes of a star tracker, each beside the truth."""

    title = "attitude over the serial line, beside the truth; errors in arcsec"
    limits_ms: ClassVar[Mapping[str, float]] = {}
    """Worst-case limit of each processing step, by its name in ``phase_ms``."""

    columns = ("frame", "right", "stars", "matched", "wrong", "cross", "roll", "status and flags")

    def count(self, options: SkyOptionsT) -> int:
        return options.frames

    def row(self, number: int, result: AttitudeResultT) -> tuple[str, ...]:
        """Verdict, numbers of stars, errors, and ending."""
        yes_no = {True: "yes", False: "no", None: "-"}
        return (
            str(number),
            yes_no[result.right] if result.solved else "no fix",
            str(result.centroids),
            str(result.matched),
            "-" if result.wrong is None else str(result.wrong),
            arcsec(result.error_cross_deg),
            arcsec(result.error_roll_deg),
            result.ending,
        )

    def summarise(self, results: Sequence[AttitudeResultT], wall_s: float) -> Iterator[str]:
        """Rates over all frames and reasons of refusals; of the right ones, 95th percentiles of
        errors and mean time; quality of the claims; the longest step."""
        right = [result for result in results if result.right]
        judged = sum(result.right is not None for result in results)
        solved = sum(result.solved for result in results)
        wrong = sum(result.solved and result.right is False for result in results)
        count = max(1, len(results))
        yield (
            f"of {len(results)}: {100 * solved / count:.1f} % solved, "
            f"{100 * len(right) / count:.1f} % right, {wrong} wrong, {wall_s:.1f} s wall time"
        )
        reasons = Counter(r.reason for r in results if not r.solved and r.reason is not None)
        if reasons:
            yield "refused: " + ", ".join(f"{number} {name}" for name, number in reasons.items())
        if right:
            # Some devices report the time of the whole measurement.
            times = [result.phase_ms["total"] for result in right if "total" in result.phase_ms]
            time = f"; mean time {np.mean(times):.0f} ms" if times else ""
            yield (
                f"95th percentile of the right ones: "
                f"{arcsec(percentile_95(result.error_cross_deg for result in right))} arcsec "
                f"across, {arcsec(percentile_95(result.error_roll_deg for result in right))} "
                f"about the boresight{time}"
            )
        inside = [
            [abs(error) / sigma for error, sigma in zip(r.error_deg, r.sigma_deg, strict=True)]
            for r in results
            if r.error_deg is not None and r.sigma_deg is not None
        ]
        if inside:
            shares = [100 * float(np.mean(np.array(inside) < limit)) for limit in (1, 3)]
            yield (
                f"of the errors about the axes {shares[0]:.0f} % are within the claimed sigma, "
                f"{shares[1]:.1f} % within three"
            )
        if longest := self.longest(results):
            yield longest
        if judged and len(right) < POOR * judged:
            yield f"what may help: {self.advice(results)}"

    def succeeded(self, results: Sequence[AttitudeResultT]) -> bool:
        return any(result.solved for result in results)

    def sections(self, results: Iterable[Mapping[str, Any]]) -> Iterator[Section]:
        known = [each for each in results if each.get("truth") is not None]
        if known:
            looking = [pointing_deg(np.array(each["truth"])) for each in known]
            ended = map(_ended, known)
            places = [(ra, dec, end) for (ra, dec, _), end in zip(looking, ended, strict=True)]
            yield Section("right results by pointing", png=sky_map(places, wilson))

    def longest(self, results: Sequence[AttitudeResultT]) -> str:
        """The worst case of each processing step and its limit; one phrase."""
        shown = [
            f"{name} {max((r.phase_ms.get(name, 0.0) for r in results), default=0.0):.1f} of {ms:g}"
            for name, ms in self.limits_ms.items()
        ]
        return f"longest, ms: {', '.join(shown)}" if shown else ""

    def advice(self, results: Sequence[AttitudeResultT]) -> str:
        """Advice if few results are right; one phrase."""
        return "--mode assisted --hint-error 3, or --profile extended"


def _ended(result: Mapping[str, Any]) -> str:
    return "right" if result["right"] else "wrong" if result["solved"] else "refused"


def percentile_95(values: Iterator[float | None]) -> float | None:
    """95th percentile of the magnitudes of the known values."""
    known = [abs(value) for value in values if value is not None]
    return float(np.percentile(known, 95)) if known else None


def arcsec(degrees: float | None) -> str:
    return "-" if degrees is None else f"{3600 * degrees:.1f}"

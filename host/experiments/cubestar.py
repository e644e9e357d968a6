"""One measured frame: what the host read over the wire, and the truth beside it."""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.interface.cubestar import IdMode, MatchMode, TaskStatus
from cubestack.host.cli.fault_plan import inject_plan
from cubestack.host.cli.session import Session, open_session
from cubestack.host.clients.cubestar.calibration import calibrate, load_camera
from cubestack.host.clients.cubestar.operator import find_threshold
from cubestack.host.errors import CameraFileError

if TYPE_CHECKING:
    from cubestack.emulator.camera.common.view import SkyView
    from cubestack.emulator.scene.sky import Scene

__all__ = ["FrameResult", "compare", "measure_frames"]

#: Names of --mode for the firmware's modes.
MODE_NAMES = {
    MatchMode.LOST_IN_SPACE: "lis",
    MatchMode.ASSISTED: "assisted",
    MatchMode.TRACKING: "tracking",
}

RIGHT_CROSS_DEG = 0.1
RIGHT_ROLL_DEG = 0.3
UNIT_TOLERANCE = 1e-3
SAME_STAR_DEG = 0.2
"""A kept star further than this from where the truth puts it has a wrong identity."""


@dataclass(frozen=True)
class FrameResult:
    """Attributes are those of the JSON output; angles in degrees, None where there is no truth."""

    solved: bool
    right: bool | None
    centroids: int
    matched: int
    wrong: int | None
    mode: str
    error_cross_deg: float | None
    error_roll_deg: float | None
    truth: list[float] | None
    quaternion: list[float] | None
    phase_ms: dict[str, float]
    wall_ms: float
    status: str

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return self.__dict__


def measure_frames(args: argparse.Namespace) -> Iterator[FrameResult]:
    """Measure ``args.frames`` frames as the options of `cubestack measure` say."""
    rng = np.random.default_rng(args.seed)
    camera = None if args.camera is None else load_camera(args.camera).cropped(*args.crop)
    view, truth = _first_view(args, rng)
    session_of = open_session(view, seed=args.seed, engine=args.engine, layout=args.layout)
    with session_of as session:
        inject_plan(session.board.faults, args.faults)
        if camera is not None:
            session.cubestar.configure(calibrate(camera).settings)
        if args.image is not None:
            find_threshold(session.cubestar)
        for number in range(args.frames):
            if number and args.image is None and args.scene is None:
                view = _random_view(args, rng)
                session.board.camera.scene = view
            yield _measure_frame(session, args, view.scene, truth, rng)


def _first_view(
    args: argparse.Namespace, rng: np.random.Generator
) -> tuple[SkyView, NDArray[np.float64] | None]:
    """What is seen in the first frame, and the truth of a picture when its camera file has it."""
    from cubestack.emulator.camera.common.scene_file import load_scene
    from cubestack.emulator.camera.common.view import SkyView
    from cubestack.emulator.camera.mlx75412.lens import CONDITION
    from cubestack.emulator.scene.sky import PictureScene

    if args.image is not None:
        view = SkyView(PictureScene(args.image, crop=args.crop), CONDITION)
        return view, _picture_truth(args.image, args.camera)
    if args.scene is not None:
        return load_scene(args.scene, CONDITION), None
    return _random_view(args, rng), None


def _random_view(args: argparse.Namespace, rng: np.random.Generator) -> SkyView:
    from cubestack.emulator.camera.common.view import SkyView
    from cubestack.emulator.camera.mlx75412.lens import CONDITION
    from cubestack.emulator.scene.attitude import random_quaternion
    from cubestack.emulator.scene.sky import SkyScene

    scene = SkyScene(
        quaternion=random_quaternion(rng),
        mag_limit=args.mag_limit,
        false_stars=args.false_stars,
        seed=int(rng.integers(1 << 31)),
    )
    return SkyView(scene, replace(CONDITION, noise=not args.no_noise, seed=scene.seed))


def _picture_truth(image: Path, camera: Path | None) -> NDArray[np.float64] | None:
    """Attitude of a picture, from the "images" object of its camera file if that has it."""
    if camera is None:
        return None
    content = json.loads(camera.read_text(encoding="utf-8"))
    try:
        quaternion = content["images"][image.name]["quaternion_xyzw_inertial_to_camera"]
    except (KeyError, TypeError):  # a camera file need not know the picture
        return None
    truth = np.array(quaternion, np.float64)
    if truth.shape != (4,) or not abs(np.linalg.norm(truth) - 1) < UNIT_TOLERANCE:
        raise CameraFileError(f"{camera}: {image.name}'s quaternion must be four of unit length")
    return truth


def _measure_frame(
    session: Session,
    args: argparse.Namespace,
    scene: Scene,
    picture_truth: NDArray[np.float64] | None,
    rng: np.random.Generator,
) -> FrameResult:
    started = time.perf_counter()
    cubestar, client = session.cubestar, session.cubestar.client
    client.command("ClearErrorFlags")
    known = scene.truth(session.board.kernel.now) if picture_truth is None else picture_truth
    if args.mode == "lis":
        client.command("setIDMode", IdMode=IdMode.LOST_IN_SPACE)
    else:
        if known is None:
            raise ValueError(f"--mode {args.mode} needs a scene whose attitude is known")
        client.command("setIDMode", IdMode=IdMode.TRACKING)
        _give_hint(session, known, 0.0 if args.mode == "tracking" else args.hint_error, rng)
        if args.mode == "tracking":
            _prime_tracking(session, scene, args.hint_error, rng)
    status = cubestar.capture_and_process()
    attitude = cubestar.attitude()
    if picture_truth is None:
        known = session.board.truth()
    solved = attitude.valid
    cross, roll = compare(attitude.quaternion, known) if solved else (None, None)
    right = None if known is None else _is_right(cross, roll)
    summary = client.telemetry("DetectionSummary")
    return FrameResult(
        solved=solved,
        right=right,
        centroids=int(summary["NumStarsDetected"]),
        matched=attitude.matched if solved else 0,
        wrong=_count_wrong(session, known) if solved else 0,
        mode=MODE_NAMES[attitude.mode] if solved else args.mode,
        error_cross_deg=cross,
        error_roll_deg=roll,
        truth=None if known is None else [float(part) for part in known],
        quaternion=[float(part) for part in attitude.quaternion] if solved else None,
        phase_ms={
            name: value for name, value in cubestar.phase_times().items() if name != "loop_total"
        },
        wall_ms=1000 * (time.perf_counter() - started),
        status=_reason(client.telemetry("ErrorFlags"), status),
    )


def compare(
    measured: NDArray[np.float64], truth: NDArray[np.float64] | None
) -> tuple[float | None, float | None]:
    """Errors across and about the boresight in degrees; None without a truth."""
    from cubestack.emulator.scene.attitude import attitude_error_deg

    return (None, None) if truth is None else attitude_error_deg(measured, truth)


def _is_right(cross: float | None, roll: float | None) -> bool:
    return (
        cross is not None
        and roll is not None
        and cross < RIGHT_CROSS_DEG
        and abs(roll) < RIGHT_ROLL_DEG
    )


def _reason(flags: dict[str, Any], status: TaskStatus) -> str:
    """Task status, and the error flags that say why."""
    return " ".join([status.name.lower(), *(name for name, up in flags.items() if up)])


def _give_hint(
    session: Session, truth: NDArray[np.float64], error_deg: float, rng: np.random.Generator
) -> None:
    """Tell the device a boresight that is at most ``error_deg`` off, uniform over that cap."""
    from cubestack.emulator.scene.attitude import matrix_from_quaternion

    matrix = matrix_from_quaternion(truth)
    away = np.radians(error_deg) * np.sqrt(rng.random())
    side = rng.random() * 2 * np.pi
    across = np.cos(side) * matrix[0] + np.sin(side) * matrix[1]
    x, y, z = np.cos(away) * matrix[2] + np.sin(away) * across
    session.cubestar.client.command(
        "setTrackingMode",
        RightAscension=float(np.arctan2(y, x)),
        Declination=float(np.arctan2(z, np.hypot(x, y))),
    )


def _prime_tracking(
    session: Session, scene: Scene, offset_deg: float, rng: np.random.Generator
) -> None:
    """Let the device find an attitude at most ``offset_deg`` from the one it will track from."""
    from cubestack.emulator.scene.sky import SkyScene

    if not isinstance(scene, SkyScene):
        raise ValueError("--mode tracking needs a sky scene: a picture has no frame before it")
    axis = rng.standard_normal(3)
    rate = offset_deg * rng.random() * axis / np.linalg.norm(axis)
    session.board.camera.scene = scene.turned(rate)
    session.cubestar.capture_and_process()
    session.board.camera.scene = scene
    session.cubestar.client.command("ClearErrorFlags")


def _count_wrong(session: Session, truth: NDArray[np.float64] | None) -> int | None:
    """Identified stars that the truth puts elsewhere; None without a truth."""
    from cubestack.emulator.scene.attitude import matrix_from_quaternion
    from cubestack.emulator.scene.hipparcos import load_sky

    if truth is None:
        return None
    cubestar = session.cubestar
    stars = {s.number: s.hipparcos for s in cubestar.stars() if s.hipparcos is not None}
    directions = _directions(session)
    sky = load_sky()
    rows = np.searchsorted(sky.hip, list(stars.values()))
    expected = sky.vectors[rows] @ matrix_from_quaternion(truth).T
    measured = directions[list(stars)]
    cosines = np.sum(expected * measured, axis=1) / np.linalg.norm(measured, axis=1)
    return int(np.sum(np.degrees(np.arccos(np.clip(cosines, -1, 1))) > SAME_STAR_DEG))


def _directions(session: Session) -> NDArray[np.float64]:
    """Camera unit vectors of the detected stars, shape (n, 3)."""
    client = session.cubestar.client
    count = int(client.telemetry("DetectionSummary")["NumStarsDetected"])
    records = [client.telemetry("BodyUnitVectors") for _ in range(count)]
    records.sort(key=lambda record: int(record["StarNumber"]))
    return np.array([[float(record[f"Vb{axis}"]) for axis in "XYZ"] for record in records])

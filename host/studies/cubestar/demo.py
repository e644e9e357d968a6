"""CubeStar: a rendered sky and a photograph captured, solved and downloaded."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.boards.cubestar.board import CubeStarBoard
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.scene.attitude import (
    matrix_from_quaternion,
    pointing_from_matrix,
    quaternion_from_pointing,
)
from cubestack.firmware_model.cubestar.detection.background_search import MOST_STARS_FACTOR
from cubestack.firmware_model.formats.untrusted import read_json
from cubestack.firmware_model.interface.cubestar.switches import CubeStarSwitches
from cubestack.host.calibration.camera import load_camera
from cubestack.host.clients.cubestar.client import Attitude, CubeStar
from cubestack.host.clients.cubestar.operator import calibrate, find_threshold
from cubestack.host.devices.device import Device
from cubestack.host.experiments.attitude import errors
from cubestack.host.experiments.scene_truth import true_stars
from cubestack.host.pictures.files import DEMO
from cubestack.host.pictures.images import annotate, save_picture
from cubestack.host.pictures.sheet import Lens
from cubestack.host.studies.demo import Demo, download, tell_times
from cubestack.host.terminal import tell

POINTING_DEG = (84.0, -1.0, 20.0)  # Orion, with Sirius
RENDERED = Path(__file__).parent / "rendered-sky.png"
PUBLISHED_PHASES = ("discard", "capture", "transfer", "detect", "match", "attitude")
PUBLISHED_TIMES = (
    "discard 68 ms, capture 388 ms, transfer 404 ms; "
    "detect and match 320 ms together for 20 stars; attitude below 10 ms"
)
"""CubeStar thesis, table 6.2, figure 5.7 and section 5.3.5; shown beside ours.

Fitted to them is the transfer alone; the discard delay of 70 ms is the published setting."""

CROP = (0, 256)  # middle rows of a 1024 x 1024 photograph


@dataclass(frozen=True)
class _Subject:
    """A subject of the demonstration."""

    name: str  #: stem of the PNG files
    title: str  #: for the reader
    scene: str  #: text of the TOML scene
    truth: NDArray[np.float64]  #: quaternion (4,), known to this command only
    camera: Path | None = None  #: camera file whose parameters are loaded by telecommand, or None

    def lens(self) -> Lens:
        """The lens that took the picture: the camera file's, or the emulated camera's own."""
        if self.camera is not None:
            return load_camera(self.camera).cropped(*CROP).directions

        return LENS.project


def show(
    device: Device[CubeStarBoard, CubeStar],
    out: Path,
    seed: int,
    photographs: Path | None,
    board: Sequence[str],
) -> bool:
    subjects = _sky(seed), _photograph(photographs)
    solved = [_show(device, subject, out, board) for subject in subjects]
    return all(solved)


def _sky(seed: int) -> _Subject:
    ra, dec, roll = POINTING_DEG
    return _Subject(
        "sky",
        "rendered sky: Orion, 2026",
        f'kind = "sky"\nra_deg = {ra}\ndec_deg = {dec}\nroll_deg = {roll}\nseed = {seed}\n',
        quaternion_from_pointing(ra, dec, roll),
    )


def _photograph(folder: Path | None) -> _Subject:
    """The first photograph of the folder, else the image shipped with this project."""
    camera = None if folder is None else folder / "truth.json"
    if folder is None or camera is None or not camera.is_file():
        return _shipped()
    images = read_json(camera)["images"]
    name = next(name for name in sorted(images) if (folder / name).is_file())
    picture = (folder / name).resolve()
    return _Subject(
        "photograph",
        f"photograph {name}: another camera, its parameters loaded by telecommand",
        f'kind = "picture"\nfile = "{picture}"\ncrop = [{CROP[0]}, {CROP[1]}]\n',
        np.array(images[name]["quaternion_xyzw_inertial_to_camera"]),
        camera,
    )


def _shipped() -> _Subject:
    truth = json.loads(RENDERED.with_suffix(".json").read_text(encoding="utf-8"))
    return _Subject(
        "photograph",
        "an image rendered by this project, as there are no photographs",
        f'kind = "picture"\nfile = "{RENDERED.resolve()}"\n',
        np.array(truth["quaternion_xyzw_inertial_to_camera"]),
    )


def _show(
    device: Device[CubeStarBoard, CubeStar], subject: _Subject, out: Path, board: Sequence[str]
) -> bool:
    """Capture, solve and download one subject; returns whether it was solved."""
    raw, marked = f"{subject.name}-raw.png", f"{subject.name}-stars.png"
    demo = Demo(out, subject.name, subject.title, raw, marked)
    with demo.client(device, subject.scene, board) as (cubestar, _):
        if subject.camera is not None:
            fit = calibrate(load_camera(subject.camera).cropped(*CROP))
            cubestar.configure(fit.settings)
            tell(f"camera parameters loaded; the fit is good to {fit.rms_px:.2f} px rms")
        threshold = find_threshold(cubestar)
        tell(f"detection threshold from a search: {threshold} DN")
        cubestar.capture_and_process()
        attitude = cubestar.attitude()
        _report(attitude, subject.truth)
        phases = cubestar.phase_times()
        tell_times({name: phases[name] for name in PUBLISHED_PHASES})
        tell(f"published:    {PUBLISHED_TIMES}")
        stars = cubestar.stars()
        left_out = left_out_by(cubestar)
        picture = download("the picture over the serial line", cubestar.stream_image)
        uptime = cubestar.client.telemetry("Identification")
    save_picture(picture, out / raw, DEMO)
    lens = subject.lens()
    truth = true_stars(subject.truth, lens, picture.shape)
    annotate(
        picture,
        stars,
        out / marked,
        f"CubeStar (star tracker), {subject.title}",
        left_out,
        lens,
        truth,
    )
    virtual_s = int(uptime["RuntimeSeconds"]) + int(uptime["RuntimeMilliseconds"]) / 1000
    demo.finish(virtual_s)
    return attitude.valid


def left_out_by(cubestar: CubeStar) -> list[str]:
    """Rejected detections and reasons, for a picture's caption."""
    summary = cubestar.client.telemetry("DetectionSummary")
    found = int(summary["NumStarsDetected"])
    most = int(cubestar.client.telemetry("MaxStars")["maxStars"])
    told = [
        f"{int(summary['AmountOfNoise'])} spots too small",
        f"{int(summary['NumInvalidStars'])} too large",
    ]
    switches = cubestar.profile()
    assert isinstance(switches, CubeStarSwitches)
    if switches.detection == "sampled" and found >= most:
        told.append(f"all after star {most}, where the search stops")
    elif switches.detection != "sampled" and found >= MOST_STARS_FACTOR * most:
        told.append(f"all but the {found} brightest")
    return told


def _report(found: Attitude, truth: NDArray[np.float64]) -> None:
    if not found.valid:
        tell("no attitude found in this picture")
        return
    if found.quaternion @ truth < 0:
        truth = -truth  # the same attitude
    tell(f"attitude from {found.matched} stars, measured beside the truth:")
    for name, q in (("measured", found.quaternion), ("truth", truth)):
        ra, dec, roll = pointing_from_matrix(matrix_from_quaternion(q))
        parts = " ".join(f"{part:+.5f}" for part in q)
        tell(f"  {name:<9} RA {ra:8.4f}°  Dec {dec:+8.4f}°  roll {roll:+9.4f}°  q [{parts}]")
    across, about = errors(found.quaternion, truth)
    tell(
        f"error: {3600 * across:.1f} arcsec across, {3600 * about:+.1f} arcsec about the boresight"
    )

"""Calibrate CubeSense's cameras: pixel of the optical axis, and the polynomial of the distortion.

Without --images it emulates a bench: the Sun, or an Earth with its limb, at known angles in front
of the unit of --seed or --scene. It fits what the sensor finds in the undistorted image, loads the
result by telecommand, and measures at random poses before and after.

With --images each image shows a light, and --angles has lines file,alpha_deg,beta_deg.

examples:
  cubestack calibrate cubesense --seed 3
  cubestack calibrate cubesense --sensor nadir --profile extended --set lens=residuals
  cubestack calibrate cubesense --images bench/ --angles bench.csv --sensor sun --out sun.json
"""

import csv
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cubestack.emulator.camera.ov7620.scene_file import load_earth_sun_scene
from cubestack.emulator.camera.ov7620.view import EarthSunView, FisheyeCondition
from cubestack.emulator.scene.earth import angular_radius_deg
from cubestack.emulator.scene.picture import load_picture
from cubestack.firmware_model.formats.untrusted import read_text
from cubestack.firmware_model.interface.cubesense.codes import PIXELS_PER_DEGREE, Camera, Sram
from cubestack.firmware_model.interface.cubesense.telecommands import DISTORTION
from cubestack.firmware_model.values import choice, whole
from cubestack.host.calibration.fisheye import Fisheye, FisheyeFit, Points, fit_fisheye, limb_angles
from cubestack.host.clients.cubesense.client import CubeSense
from cubestack.host.devices.experiment import Experiment, Result
from cubestack.host.experiments.cubesense.measure import (
    CubeSenseOpener,
    CubeSenseOptions,
    measure_once,
    random_view,
    view_of,
)
from cubestack.host.options import Options, output_option, path_option
from cubestack.host.output import write_output

FIELD = (PIXELS_PER_DEGREE, 95.0)
"""Undistorted pixels per degree, and the largest field angle in deg."""

UNDISTORTED = (0.0, 1.0, 0.0, 0.0, 0.0)
"""Factors without distortion."""

FINEST = "distortion=equidistant,edges=sub-pixel,sun=confirmed"
"""Switches of the firmware at the bench: it reports positions in 1/100 px."""

REACH_DEG = {Camera.SUN: 88.0, Camera.NADIR: 30.0}
"""Largest angle at the bench: the Sun's image, and the limb, are then within the rim."""

SETTLE_S = 1.5
"""Virtual time until cameras and tables are ready."""

DEFAULT_POSES = 60
FAINTEST = 20
"""Smallest contrast of a light in DN."""


@dataclass(frozen=True, kw_only=True)
class CalibrateOptions(Options):
    """Options of `cubestack calibrate cubesense`."""

    scene: Any = path_option(None, "TOML scene whose cameras the unit has")
    seed: int = whole(0, "the unit's serial number, and seed of all else (default 0)", 0)
    sensor: str = choice("both", "default: both", ("both", "sun", "nadir"))
    emulated: int | None = whole(
        None, "poses at the emulated bench (default 60)", 8, metavar="N", group="pictures"
    )
    images: Path | None = path_option(
        None, "a folder of pictures, a light in each", metavar="PATH", group="pictures"
    )
    angles: Path | None = path_option(None, "with --images: where the lights were, a CSV file")
    check_poses: int = whole(
        30, "random poses measured before and after (default 30)", 1, metavar="N"
    )
    out: Path | None = output_option(None, "JSON file to be written")

    def check(self) -> None:
        """Images need angles and one sensor; the bench needs neither."""
        if (self.images is None) != (self.angles is None):
            raise ValueError("--images and --angles are needed together")
        if self.images is not None and (self.sensor == "both" or self.scene is not None):
            raise ValueError("--images are of one camera: --sensor sun or nadir, without --scene")


@dataclass(frozen=True)
class CalibrateResult(Result):
    """Attributes are those of the JSON output."""

    sensor: str  #: "sun" or "nadir"
    #: boresight_px, factors: parameters of telecommands Boresight and Distortion
    boresight_px: tuple[float, float]
    factors: tuple[float, ...]
    places: int  #: number of positions fitted
    #: before_px, after_px: root mean square residual with the tables, and fitted
    before_px: float
    after_px: float
    #: error_before_deg, error_after_deg: mean angle between measured and true direction at random
    #: poses, with the tables, and with the result loaded; None for pictures
    error_before_deg: float | None
    error_after_deg: float | None


class _Experiment(Experiment["CubeSenseOpener", CalibrateOptions, CalibrateResult]):
    options = CalibrateOptions
    description = __doc__
    label = ""

    def run(self, opened: CubeSenseOpener, options: CalibrateOptions) -> Iterator[CalibrateResult]:
        results = []
        for camera in [camera for camera in Camera if options.sensor in ("both", _name(camera))]:
            reset = opened.device.interface.telecommand(f"Boresight{camera + 1}").reset_values()
            tables = Fisheye(float(reset["X"]), float(reset["Y"]), DISTORTION, *FIELD)
            errors: Sequence[float | None] = (None, None)
            if options.images is not None and options.angles is not None:
                fit = _photographed(options.images, options.angles, tables)
            else:
                fit = _bench(opened, options, camera, tables)
                errors = _checked(opened, options, camera, fit.lens)
            places = (fit.lens.x_px, fit.lens.y_px), fit.lens.factors, fit.places
            results.append(
                CalibrateResult(_name(camera), *places, fit.before_px, fit.after_px, *errors)
            )
            yield results[-1]
        if options.out is not None:
            told = {one.sensor: one.as_dict() for one in results}
            write_output(options.out, json.dumps(told, indent=2) + "\n")

    def summarise(self, results: Sequence[CalibrateResult], wall_s: float) -> Iterator[str]:
        for one in results:
            number = Camera[one.sensor.upper()] + 1
            x, y = one.boresight_px
            yield f"{one.sensor}: {one.places} places; {one.before_px:.3f} px from the tables"
            yield f"  after the fit {one.after_px:.3f} px"
            yield f"  Boresight{number} X={x:.2f} Y={y:.2f}"
            yield f"  Distortion{number}, from the constant up: " + " ".join(
                f"{factor:.4g}" for factor in one.factors
            )
            if one.error_before_deg is not None:
                yield (
                    f"  error at random poses: mean {one.error_before_deg:.3f} deg before, "
                    f"{one.error_after_deg:.3f} deg after"
                )
        yield f"{wall_s:.1f} s wall time"


def _name(camera: Camera) -> str:
    return camera.name.lower()


def _bench(
    opened: CubeSenseOpener, options: CalibrateOptions, camera: Camera, tables: Fisheye
) -> FisheyeFit:
    """Fit to known poses, evenly spread over the field."""
    count = options.emulated or DEFAULT_POSES
    turn = np.pi * (3 - np.sqrt(5)) * np.arange(count)
    radius = REACH_DEG[camera] * np.sqrt((np.arange(count) + 0.5) / count)
    angles = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    unit = _unit(options)
    pixels, known = [np.empty((0, 2))], [np.empty((0, 2))]
    views = [
        unit(view_of(camera, (float(alpha), float(beta)), FisheyeCondition(seed=number)))
        for number, (alpha, beta) in enumerate(angles)
    ]
    switches = ",".join(filter(None, (opened.board.get("set"), FINEST)))
    with opened(views[0], seed=options.seed, set=switches) as emulated:
        cubesense = emulated.client
        cubesense.set_distortion(camera, UNDISTORTED)
        cubesense.client.pause(SETTLE_S)
        shown = opened.shown(zip(views, angles, strict=True), count, f"{_name(camera)}: bench")
        for view, at in shown:
            emulated.scene = view
            if cubesense.capture_and_detect(camera).detected:
                found = _places(cubesense, camera, tables)
                pixels.append(found)
                known.append(np.broadcast_to(at, found.shape))
    centres, places = np.concatenate(known), np.concatenate(pixels)
    if camera is Camera.SUN:
        return fit_fisheye(places, lambda _: centres, tables, outline=False)
    limb_deg = angular_radius_deg(views[0].scene.altitude_km)
    return fit_fisheye(
        places, lambda azimuths: limb_angles(azimuths, centres, limb_deg), tables, outline=True
    )


def _places(cubesense: CubeSense, camera: Camera, tables: Fisheye) -> Points:
    """Pixels (n, 2) of the Sun, or of the limb's edges, in the latest picture."""
    if camera is Camera.NADIR:
        return cubesense.edges()
    details = cubesense.details(camera)
    return np.array([[tables.x_px + float(details["X"]), tables.y_px + float(details["Y"])]])


def _checked(
    opened: CubeSenseOpener, options: CalibrateOptions, camera: Camera, lens: Fisheye
) -> tuple[float, float]:
    """Mean error at random poses, deg, with the tables and with ``lens`` loaded."""
    rng, unit = np.random.default_rng(options.seed), _unit(options)
    views = [unit(random_view(CubeSenseOptions(), camera, rng)) for _ in range(options.check_poses)]
    means = []
    with opened(views[0], seed=options.seed) as emulated:
        emulated.client.client.pause(SETTLE_S)
        for label in ("tables", "calibrated"):
            if label == "calibrated":
                emulated.client.set_boresight(camera, lens.x_px, lens.y_px)
                emulated.client.set_distortion(camera, lens.factors)
                emulated.client.client.pause(SETTLE_S)
            errors = []
            for view in opened.shown(views, len(views), f"{_name(camera)}: {label}"):
                emulated.scene = view
                errors.append(measure_once(emulated, camera, Sram(camera)).error_deg)
            means.append(float(np.mean([error for error in errors if error is not None])))
    return means[0], means[1]


def _unit(options: CalibrateOptions) -> Callable[[EarthSunView], EarthSunView]:
    """Applies the lenses of the scene's cameras to a view, if given."""
    if options.scene is None:
        return lambda view: view
    own = load_earth_sun_scene(options.scene).condition

    def given(view: EarthSunView) -> EarthSunView:
        lenses = replace(view.condition, nadir_lens=own.nadir_lens, sun_lens=own.sun_lens)
        return EarthSunView(view.scene, lenses)

    return given


def _photographed(folder: Path, angles: Path, tables: Fisheye) -> FisheyeFit:
    """Fit to images of lights; raises ValueError with the wrong line or image."""
    pixels, known = [], []
    try:
        lines = list(csv.DictReader(read_text(angles).splitlines()))
    except OSError as error:
        raise ValueError(f"{angles} can not be read: {error.strerror}") from None
    for number, line in enumerate(lines, start=2):
        try:
            known.append([float(line["alpha_deg"]), float(line["beta_deg"])])
            path = folder / line["file"]
        except (KeyError, TypeError, ValueError):
            raise ValueError(
                f"{angles}, line {number}: must be file,alpha_deg,beta_deg, as its first line says"
            ) from None
        grey = load_picture(path).astype(float)
        light = grey - (np.median(grey) + grey.max()) / 2
        if light.max() < FAINTEST / 2:
            raise ValueError(f"{path} shows no light {FAINTEST} grey values above its background")
        y, x = np.nonzero(light > 0)
        weights = light[y, x]
        pixels.append([x @ weights / weights.sum(), y @ weights / weights.sum()])
    at = np.array(known).reshape(-1, 2)
    return fit_fisheye(np.array(pixels).reshape(-1, 2), lambda _: at, tables, outline=False)


EXPERIMENT = _Experiment()

"""Calibrate a device's camera from images of a real or an emulated unit.

The result can be loaded into the device or `cubestack measure`; docs/how-to/calibration.md
describes how to take the images.

examples:
  cubestack calibrate {first} --emulated 20 --out camera.json
  cubestack calibrate DEVICE --help
"""

import argparse
from abc import abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, Generic, TypeAlias, TypeVar

import numpy as np

from cubestack.emulator.boards.contract import Board
from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.common.view import SkyCondition, SkyView
from cubestack.emulator.scene.attitude import random_quaternion
from cubestack.emulator.scene.hipparcos import load_sky
from cubestack.emulator.scene.picture import PictureScene, load_picture
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.values import whole
from cubestack.host.calibration.camera import Camera, load_camera, save_camera
from cubestack.host.calibration.stars import PARAMETERS, Fit, Sight, fit_camera
from cubestack.host.cli.arguments import Parser
from cubestack.host.cli.measure import add_devices, run_experiment
from cubestack.host.clients.contract import DeviceClient, FoundStar
from cubestack.host.devices.experiment import Experiment, Result
from cubestack.host.experiments.opener import Opener
from cubestack.host.options import Options, output_option, path_option
from cubestack.host.pictures.files import CALIBRATE, is_from
from cubestack.host.pictures.images import save_residuals
from cubestack.host.studies.star_log import load_sights

SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff")
DEFAULT_PICTURES = 20
GRID = (33, 17)


@dataclass(frozen=True, kw_only=True)
class CalibrateOptions(Options):
    """Options of every star tracker's calibration."""

    scene: Any = path_option(None, "with --emulated: TOML scene whose camera the unit has")
    seed: int = whole(0, "seed of everything random (default 0)", 0)
    images: Path | None = path_option(
        None, "a picture, or a folder of them", metavar="PATH", group="pictures"
    )
    emulated: int | None = whole(
        None,
        f"pictures of random skies, taken by an emulated unit (default: {DEFAULT_PICTURES})",
        1,
        metavar="N",
        group="pictures",
    )
    stars: Path | None = path_option(
        None,
        "identified stars that a unit has reported: per line a JSON list of [Hipparcos number, "
        "column, row]",
        group="pictures",
    )
    camera: Path | None = path_option(
        None, "JSON with a rough f_px, cx_px, cy_px, k1, k2, p1, p2; default: the device's tables"
    )
    rounds: int = whole(2, "times that stars are identified, each with the camera found before", 1)
    out: Path | None = output_option(
        None, "camera file to be written, and beside it a .png of residuals"
    )

    def check(self) -> None:
        """A scene needs emulated images; the camera's file must be writable."""
        if not self.is_emulated and self.scene is not None:
            raise ValueError("--scene requires --emulated: it sets the unit's lens")
        if self.out is not None and (self.out.suffix != ".json" or not self.out.parent.is_dir()):
            raise ValueError(f"--out must be a file NAME.json in a folder that is, not {self.out}")
        drawn = self.residuals
        if drawn is not None and drawn.exists() and not is_from(CALIBRATE, drawn):
            raise ValueError(f"{drawn} exists, and shows no residuals; choose another --out")

    @property
    def is_emulated(self) -> bool:
        return self.images is None and self.stars is None

    @property
    def residuals(self) -> Path | None:
        """The picture of residuals; one of an earlier calibration is replaced."""
        return self.out and self.out.with_suffix(".png")

    @property
    def pictures(self) -> list[Path]:
        """The files of ``images`` by name; raises ValueError if there are none."""
        given = self.images
        if given is None:
            return []
        if not given.is_dir():
            return [given]
        found = sorted(path for path in given.iterdir() if path.suffix.lower() in SUFFIXES)
        if not found:
            raise ValueError(f"{given} has no pictures: {', '.join(SUFFIXES)}")
        return found


@dataclass(frozen=True, eq=False)
class _Look:
    """A sky, or the part of an image from ``corner`` on."""

    scene: Any
    picture: Path | None = None
    corner: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class CalibrateResult(Result):
    """Attributes are those of the JSON output."""

    #: the fitted parameters, as a camera file has them, and ``sigma`` their deviations
    camera: dict[str, float]
    sigma: dict[str, float]
    pairs_f_px: float | None  #: focal length by star pairs near the middle; None without any
    pictures: int  #: images used, of all ``tried``; each part of a large image counts
    tried: int
    #: stars, rejected: stars used, and outliers
    stars: int
    rejected: int
    #: before_px, after_px: root mean square residual with the camera at first, and fitted
    before_px: float
    after_px: float
    #: root mean square distance of the fitted camera from the emulated unit's lens over the
    #: picture, at the best rotation; None for an unknown lens
    lens_px: float | None


ClientT = TypeVar("ClientT", bound=DeviceClient)
_Opener: TypeAlias = "Opener[Board, ClientT]"


class StarCalibration(
    Experiment["_Opener[ClientT]", CalibrateOptions, CalibrateResult], Generic[ClientT]
):
    """Calibrates a star tracker's camera: images in, stars identified by the device, a fit.

    The device detects and identifies with its own firmware; the fit uses only what comes back over
    its serial line, with directions from the catalogue. It uses profile ``extended``: the
    published one identifies few stars with a lens that is a pixel off.
    """

    options = CalibrateOptions
    label = ""
    decides = ("profile", "set")
    size: tuple[int, int]  #: columns and rows of the sensor
    free: Sequence[str] = PARAMETERS  #: parameters that are fitted
    mag_limit: float | None = None  #: of the emulated sky; None for none

    @abstractmethod
    def tables(self) -> Optics: ...

    @abstractmethod
    def condition(self, options: CalibrateOptions) -> SkyCondition: ...

    @abstractmethod
    def load(self, client: ClientT, camera: Camera, light: Path | None) -> None:
        """Load the camera into the device, and settings for an image file."""

    @abstractmethod
    def identify(self, client: ClientT) -> Sequence[FoundStar]:
        """Capture an image; returns the identified stars if there is an attitude."""

    def board(self, camera: Camera) -> Mapping[str, Any]:
        return {}

    def run(
        self, opened: "_Opener[ClientT]", options: CalibrateOptions
    ) -> Iterator[CalibrateResult]:
        given = options.camera
        guess = camera = self._like(self.tables()) if given is None else load_camera(given)
        if options.stars is not None:
            sights = load_sights(options.stars)
            fit = fit_camera(sights, camera, self.free)
            camera = fit.camera
        else:
            looks = self._looks(options)
            for number in range(options.rounds):
                label = f"identifying stars, round {number + 1}"
                pictures = self._sights(opened, options.seed, looks, camera)
                sights = list(opened.shown(pictures, len(looks), label))
                fit = fit_camera(sights, camera, self.free)
                camera = fit.camera
        before = fit_camera(sights, guess, ()).after_px
        if options.out is not None and options.residuals is not None:
            save_camera(camera, options.out)
            save_residuals(fit.places, fit.residuals, options.residuals)
        lens_px = None
        if options.is_emulated:
            lens_px = self._over_picture(self.condition(options).optics, camera, ()).after_px
        yield CalibrateResult(
            camera=asdict(camera),
            sigma=fit.sigma,
            pairs_f_px=fit.pairs_f_px,
            pictures=fit.pictures,
            tried=len(sights),
            stars=len(fit.places),
            rejected=fit.rejected,
            before_px=before,
            after_px=fit.after_px,
            lens_px=lens_px,
        )

    def _looks(self, options: CalibrateOptions) -> list[_Look]:
        """All views; large images in parts that do not overlap."""
        if options.images is None:
            rng, own = np.random.default_rng(options.seed), self.condition(options)
            skies = [
                SkyScene(random_quaternion(rng), mag_limit=self.mag_limit)
                for _ in range(options.emulated or DEFAULT_PICTURES)
            ]
            return [
                _Look(SkyView(sky, replace(own, seed=number))) for number, sky in enumerate(skies)
            ]
        looks = []
        for path in options.pictures:
            sides = zip(load_picture(path).shape, reversed(self.size), strict=True)
            tops, lefts = (range(0, max(1, there - own + 1), own) for there, own in sides)
            for corner in product(lefts, tops):
                looks.append(_Look(PictureScene(path, crop=corner), path, corner))
        return looks

    def _sights(
        self, opened: "_Opener[ClientT]", seed: int, looks: Sequence[_Look], camera: Camera
    ) -> Iterator[Sight]:
        """Each image's identified stars, with ``camera`` loaded."""
        sky = load_sky()
        own = self.board(camera)
        with opened(looks[0].scene, seed=seed, profile="extended", **own) as emulated:
            for look in looks:
                emulated.scene = look.scene
                self.load(emulated.client, camera.cropped(*look.corner), look.picture)
                stars = self.identify(emulated.client)
                named = {star.hipparcos: (star.x_px, star.y_px) for star in stars}
                named.pop(None, None)
                places = np.array([*named.values()], np.float64).reshape(-1, 2) + look.corner
                rows = np.searchsorted(sky.hip, np.array([*named], np.int64))
                yield Sight(places, sky.vectors[rows])

    def _like(self, optics: Optics) -> Camera:
        f_px = 1000 * optics.focal_length_mm / optics.pixel_pitch_um
        return self._over_picture(optics, Camera(f_px, optics.cx, optics.cy), self.free).camera

    def _over_picture(self, optics: Optics, camera: Camera, free: Sequence[str]) -> Fit:
        """Fit a camera to a lens over the picture, at the best rotation."""
        sides = zip(self.size, GRID, strict=True)
        columns, rows = (np.linspace(0, side - 1, places) for side, places in sides)
        pixels = np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2)
        return fit_camera([Sight(pixels, optics.unproject(pixels))], camera, free, exact=True)

    def summarise(self, results: Sequence[CalibrateResult], wall_s: float) -> Iterable[str]:
        for result in results:
            yield (
                f"{result.stars} stars of {result.pictures} pictures ({result.tried} tried, "
                f"{result.rejected} stars left out)"
            )
            for name, value in result.camera.items():
                if name in result.sigma:
                    yield f"{name:6} {value:12.5f} +- {result.sigma[name]:.5f}"
            if result.pairs_f_px is not None:
                yield f"focal length by star pairs near the middle: {result.pairs_f_px:.1f} px"
            yield f"residual: {result.before_px:.3f} px before, {result.after_px:.3f} px after"
            if result.lens_px is not None:
                yield f"from the emulated unit's own lens: {result.lens_px:.3f} px"
        yield f"{wall_s:.1f} s wall time"


def add_arguments(parser: Parser) -> None:
    """Declare the devices that can be calibrated, each with options of its own."""
    add_devices(parser, lambda device: device.studies.get("calibrate"))


def run(args: argparse.Namespace) -> int:
    """Calibrate; returns 0 when there is a result."""
    return run_experiment(args, *args.chosen)

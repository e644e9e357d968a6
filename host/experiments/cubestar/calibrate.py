"""Calibrate CubeStar's camera from pictures of the sky: focal length, principal point, distortion.

The emulated device detects and identifies the stars of each picture; the fit is to the catalogue's
directions. Without --images an emulated unit takes the pictures, whose lens is that of --scene, or
drawn from the published uncertainties.

examples:
  cubestack calibrate cubestar --emulated 20 --out camera.json
  cubestack calibrate cubestar --images night/ --camera rough.json --out camera.json
  cubestack measure cubestar --image night/1.jpg --camera camera.json
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS
from cubestack.firmware_model.interface.cubestar import IdMode
from cubestack.host.calibration.camera import Camera
from cubestack.host.calibration.stars import Sight
from cubestack.host.clients.cubestar.calibration import calibrate
from cubestack.host.clients.cubestar.client import CubeStar
from cubestack.host.clients.cubestar.operator import find_threshold
from cubestack.host.experiments.calibrate import (
    CalibrateOptions,
    StarCalibration,
    camera_like,
    sight_of,
)
from cubestack.host.experiments.opener import Opener

if TYPE_CHECKING:
    from cubestack.emulator.boards.cubestar.board import CubeStarBoard
    from cubestack.emulator.camera.common.optics import Optics
    from cubestack.emulator.camera.common.view import SkyCondition, SkyView

_Opener: TypeAlias = "Opener[CubeStarBoard, CubeStar]"

MAG_LIMIT = 3.8
"""Of the emulated sky: the onboard list's own."""

PROFILE = "extended"
"""Of the firmware that names the stars: as printed, it names few with a lens a pixel off."""


class _Experiment(StarCalibration["_Opener", CalibrateOptions]):
    options = CalibrateOptions
    description = __doc__
    size = (COLUMNS, ROWS)
    decides = ("profile", "set")

    def guess(self, options: CalibrateOptions) -> Camera:
        from cubestack.emulator.camera.mlx75412.lens import LENS

        return camera_like(LENS, self.size)

    def optics(self, options: CalibrateOptions) -> "Optics":
        return _condition(options).optics

    def sights(self, opened: _Opener, options: CalibrateOptions, camera: Camera) -> Iterator[Sight]:
        from cubestack.emulator.scene.sky import PictureScene

        looks: list[tuple[tuple[int, int], PictureScene | SkyView]]
        if options.images is None:
            rng = np.random.default_rng(options.seed)
            condition = _condition(options)
            looks = [((0, 0), _sky(condition, rng)) for _ in range(self.tried(options))]
        else:
            looks = [(at, PictureScene(path, crop=at)) for path, at in self.parts(options)]
        with opened(looks[0][1], seed=options.seed, profile=PROFILE) as emulated:
            for corner, scene in looks:
                emulated.scene = scene
                emulated.client.configure(calibrate(camera.cropped(*corner)).settings)
                if options.images is not None:
                    find_threshold(emulated.client)
                yield _identified(emulated.client, corner)


def _condition(options: CalibrateOptions) -> "SkyCondition":
    from cubestack.emulator.camera.common.scene_file import drawn_optics, load_scene
    from cubestack.emulator.camera.mlx75412.lens import CONDITION, LENS, UNCERTAIN

    if options.scene is None:
        return replace(CONDITION, optics=drawn_optics(LENS, UNCERTAIN, options.seed))
    return load_scene(options.scene, CONDITION, UNCERTAIN).condition


def _sky(condition: "SkyCondition", rng: np.random.Generator) -> "SkyView":
    from cubestack.emulator.camera.common.view import SkyView
    from cubestack.emulator.scene.attitude import random_quaternion
    from cubestack.emulator.scene.sky import SkyScene

    scene = SkyScene(random_quaternion(rng), mag_limit=MAG_LIMIT, seed=int(rng.integers(1 << 31)))
    return SkyView(scene, replace(condition, seed=scene.seed))


def _identified(cubestar: CubeStar, corner: tuple[int, int]) -> Sight:
    """The stars that the device names in what it sees, at places in the whole picture."""
    cubestar.client.command("setIDMode", IdMode=IdMode.LOST_IN_SPACE)
    cubestar.capture_and_process()
    stars = cubestar.stars() if cubestar.attitude().valid else []
    named = {
        star.hipparcos: (star.x_px + corner[0], star.y_px + corner[1])
        for star in stars
        if star.hipparcos is not None
    }
    return sight_of(named)


EXPERIMENT = _Experiment()

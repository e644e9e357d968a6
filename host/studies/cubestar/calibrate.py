"""Calibrate CubeStar's camera from pictures of the sky: focal length, principal point, distortion.

The emulated device detects and identifies the stars of each picture; the fit is to the catalogue's
directions. Without --images an emulated unit takes the pictures, whose lens is that of --scene, or
drawn from the published uncertainties.

examples:
  cubestack calibrate cubestar --emulated 20 --out camera.json
  cubestack calibrate cubestar --images night/ --camera rough.json --out camera.json
  cubestack measure cubestar --image night/1.jpg --camera camera.json
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.common.scene_file import draw_optics, load_scene
from cubestack.emulator.camera.common.view import SkyCondition
from cubestack.emulator.camera.mlx75412.lens import CONDITION, LENS, UNCERTAIN
from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS
from cubestack.firmware_model.interface.cubestar import IdMode
from cubestack.host.calibration.camera import Camera
from cubestack.host.clients.contract import FoundStar
from cubestack.host.clients.cubestar.client import CubeStar
from cubestack.host.clients.cubestar.operator import calibrate, find_threshold
from cubestack.host.studies.calibrate import CalibrateOptions, StarCalibration


class _Experiment(StarCalibration[CubeStar]):
    description = __doc__
    size = (COLUMNS, ROWS)
    mag_limit = 3.8  # the onboard list's own

    def tables(self) -> Optics:
        return LENS

    def condition(self, options: CalibrateOptions) -> SkyCondition:
        if options.scene is None:
            return replace(CONDITION, optics=draw_optics(LENS, UNCERTAIN, options.seed))
        return load_scene(options.scene, CONDITION, UNCERTAIN).condition

    def load(self, client: CubeStar, camera: Camera, light: Path | None) -> None:
        client.configure(calibrate(camera).settings)
        if light is not None:
            find_threshold(client)

    def identify(self, client: CubeStar) -> Sequence[FoundStar]:
        client.client.command("setIDMode", IdMode=IdMode.LOST_IN_SPACE)
        client.capture_and_process()
        return client.stars() if client.attitude().valid else []


EXPERIMENT = _Experiment()

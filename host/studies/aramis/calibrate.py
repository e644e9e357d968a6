"""Calibrate AraMiS' camera from pictures of the sky: focal length and principal point.

The emulated star tracker detects and identifies the stars of each picture; the fit is to the
catalogue's directions. Its lens does not distort. Without --images an emulated unit takes the
pictures, whose lens is that of --scene, or that of the tables.

examples:
  cubestack calibrate aramis --emulated 20 --scene unit.toml
  cubestack calibrate aramis --images night/ --camera rough.json --out camera.json
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cubestack.emulator.boards.aramis.catalogue import onboard_database
from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.common.scene_file import load_scene
from cubestack.emulator.camera.common.view import SkyCondition
from cubestack.emulator.camera.mt9m001.lens import CONDITION
from cubestack.firmware_model.interface.aramis import OnOff
from cubestack.firmware_model.interface.cameras.mt9m001 import COLUMNS, ROWS
from cubestack.host.calibration.camera import Camera
from cubestack.host.clients.aramis.client import Aramis
from cubestack.host.clients.contract import FoundStar
from cubestack.host.studies.calibrate import CalibrateOptions, StarCalibration


class _Experiment(StarCalibration[Aramis]):
    description = __doc__
    size = (COLUMNS, ROWS)
    free = ("f_px", "cx_px", "cy_px")

    def tables(self) -> Optics:
        return CONDITION.optics

    def condition(self, options: CalibrateOptions) -> SkyCondition:
        own = options.scene
        return CONDITION if own is None else load_scene(own, CONDITION).condition

    def board(self, camera: Camera) -> Mapping[str, Any]:
        del camera
        return {"catalogue": onboard_database()}

    def load(self, client: Aramis, camera: Camera, light: Path | None) -> None:
        """This star tracker has only the field as a lens parameter."""
        field_deg = 2 * np.degrees(np.arctan(ROWS / 2 / camera.f_px))
        client.client.command("SetField", FieldOfView=float(field_deg), Round=OnOff.ON)
        client.client.wait_processed(1.0)
        client.activate()

    def identify(self, client: Aramis) -> Sequence[FoundStar]:
        return client.stars() if client.measure().valid else []


EXPERIMENT = _Experiment()

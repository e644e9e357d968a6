from unittest.mock import Mock, call

import pytest

from cubestack.firmware_model.interface.aramis import OnOff
from cubestack.firmware_model.interface.cameras.mt9m001 import ROWS
from cubestack.host.calibration.camera import Camera
from cubestack.host.studies.aramis.calibrate import EXPERIMENT


def test_load_sets_the_field_before_it_activates_the_catalogue() -> None:
    """A focal length of half the picture's height has it 90 degrees high."""
    aramis = Mock()
    EXPERIMENT.load(aramis, Camera(ROWS / 2, 640.0, 512.0), None)
    field = call.client.command("SetField", FieldOfView=pytest.approx(90.0), Round=OnOff.ON)
    assert aramis.mock_calls == [field, call.client.wait_processed(1.0), call.activate()]

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest

from cubestack.firmware_model.interface.cubesense.codes import Camera
from cubestack.host.calibration.fisheye import Fisheye
from cubestack.host.studies.cubesense import calibrate

LENS = Fisheye(300.0, 250.0, (0.5, 1.0, 0.0, 0.0, 0.0), 1.45, 95.0)


class Bench:
    def __init__(self) -> None:
        self.client = Mock()

    def __call__(self, _scene: object, *, seed: int) -> Any:
        return nullcontext(SimpleNamespace(client=self.client))

    def shown(self, views: Any, _count: int, _label: str) -> Any:
        return iter(views)


def test_fitted_lens_is_loaded_before_the_second_error(monkeypatch: pytest.MonkeyPatch) -> None:
    bench, options = Bench(), calibrate.CalibrateOptions(check_poses=3)

    def measured(*_: object) -> SimpleNamespace:
        told = bench.client.set_boresight.called and bench.client.set_distortion.called
        return SimpleNamespace(error_deg=0.25 if told else 1.5)

    monkeypatch.setattr(calibrate, "measure_once", measured)
    opened: Any = bench
    assert calibrate._checked(opened, options, Camera.SUN, LENS) == (1.5, 0.25)
    bench.client.set_boresight.assert_called_once_with(Camera.SUN, 300.0, 250.0)
    bench.client.set_distortion.assert_called_once_with(Camera.SUN, LENS.factors)

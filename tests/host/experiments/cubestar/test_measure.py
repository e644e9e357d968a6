"""Frames of random skies, beside what their device did."""

from typing import Any

import pytest

from cubestack.firmware_model.interface.cameras.mlx75412 import ROWS
from cubestack.host.experiments.measure import measure


def test_what_crosses_a_later_frame_is_there_while_it_is_exposed() -> None:
    devices = list[Any]()
    list(measure("cubestar", frames=2, hazard=("debris",), mag_limit=2.0, opened=devices.append))
    (emulated,) = devices
    (debris,) = emulated.scene.hazards
    exposed_s = emulated.board.stored[-1].mid_exposure_ps(ROWS / 2) / 1e12
    assert debris.time_s == pytest.approx(exposed_s, abs=0.1)

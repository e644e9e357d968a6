from typing import Any

import pytest

from cubestack.firmware_model.interface.cubestar import IdMode
from cubestack.host.studies.cubestar.calibrate import EXPERIMENT


class Unit:
    """A CubeStar in tracking mode; ``modes`` are the identification modes of its pictures."""

    def __init__(self, valid: bool) -> None:
        self.valid = valid
        self.modes = list[IdMode]()
        self._mode = IdMode.TRACKING
        self.client = self

    def command(self, _name: str, *, IdMode: IdMode) -> None:
        self._mode = IdMode

    def capture_and_process(self) -> None:
        self.modes.append(self._mode)

    def attitude(self) -> "Unit":
        return self

    def stars(self) -> list[str]:
        return ["a star"]


@pytest.mark.parametrize("valid", [True, False])
def test_pictures_are_matched_lost_in_space_and_need_an_attitude(valid: bool) -> None:
    unit: Any = Unit(valid)
    assert EXPERIMENT.identify(unit) == (["a star"] if valid else [])
    assert unit.modes == [IdMode.LOST_IN_SPACE]

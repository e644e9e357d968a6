"""A star tracker, at rest and active."""

import pytest

from cubestack.firmware_model.interface.aramis import CatalogueState

from .desk import Desk


@pytest.fixture
def desk() -> Desk:
    return Desk()


@pytest.fixture
def active(desk: Desk) -> Desk:
    assert desk.aramis.activate() is CatalogueState.GOOD
    return desk

"""Trackers and their lists, which take a second each."""

import pytest

from cubestack.host.studies.compare.database import Catalogue
from cubestack.host.studies.compare.tracker import Tracker, tracker


@pytest.fixture(scope="session")
def cubestar() -> Catalogue:
    return Catalogue(tracker("cubestar"))


@pytest.fixture(scope="session")
def aramis() -> Catalogue:
    return Catalogue(tracker("aramis"))


@pytest.fixture
def star_tracker(cubestar: Catalogue) -> Tracker:
    return cubestar.tracker

"""Tests of one xdist group run in one process."""

import pytest


@pytest.mark.xdist_group("kept together")
def test_groups_are_known(request: pytest.FixtureRequest) -> None:
    """Some versions of pytest and xdist ignore groups without a warning."""
    if not request.config.getoption("loadgroup", False):
        pytest.skip("tests run in one process or without groups")
    assert request.node.nodeid.endswith("@kept together")

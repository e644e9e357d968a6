"""Tests of one group run in one process, which starts what they share once."""

import pytest


@pytest.mark.xdist_group("kept together")
def test_groups_are_known(request: pytest.FixtureRequest) -> None:
    """Some pairs of pytest and xdist lose them, and say nothing: all is just slow."""
    if not request.config.getoption("loadgroup", False):
        pytest.skip("tests run in one process, or are not grouped")
    assert request.node.nodeid.endswith("@kept together")

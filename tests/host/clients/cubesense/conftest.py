import pytest

from ...conftest import FakeCubeSense


@pytest.fixture
def node() -> FakeCubeSense:
    return FakeCubeSense()

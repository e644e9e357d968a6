from collections.abc import Iterator

import pytest

from cubestack.firmware_model.interface.cubestar import INTERFACE, AckError
from cubestack.host.clients.node import NodeClient
from cubestack.host.devices.registry import device
from cubestack.host.errors import CommandRefusedError, NoAnswerError
from cubestack.host.ground.session import LinkState, TargetSession
from cubestack.host.targets import Target

from ..conftest import FakeCubeStar, UartLink


class Behind:
    """A session and the node of its line."""

    def __init__(self) -> None:
        self.node = FakeCubeStar()
        line = UartLink(self.node)
        self.session = TargetSession(Target("fake", INTERFACE, NodeClient(line, INTERFACE), line))


@pytest.fixture
def behind() -> Iterator[Behind]:
    one = Behind()
    yield one
    one.session.close()


def test_refusal_does_not_break_the_link(behind: Behind) -> None:
    behind.node.refusals.append(AckError.BAD_PARAMETER)
    with pytest.raises(CommandRefusedError, match="CaptureAndProcess refused: BAD_PARAMETER"):
        behind.session.execute("write CaptureAndProcess").result()
    assert behind.session.link == LinkState()


def test_silent_node_breaks_the_link_until_it_answers(behind: Behind) -> None:
    behind.node.lost = 100
    with pytest.raises(NoAnswerError):
        behind.session.execute("read TaskStatus").result()
    link = behind.session.link
    assert (link.failed, link.broken) == (1, True)
    behind.node.lost = 0
    behind.session.execute("read TaskStatus").result()
    assert (link.failed, link.broken) == (1, False)


@pytest.mark.parametrize("client", ["cubestar", None])
def test_missing_features_depend_on_the_device(client: str | None) -> None:
    line = UartLink(FakeCubeStar())
    known = None if client is None else device(client)
    session = TargetSession(
        Target("fake", INTERFACE, NodeClient(line, INTERFACE), line, device=known)
    )
    without = {"detections", "results", "download", "upload", "scene_form", "sensor_registers"}
    assert without & session.about["missing"].keys() == (set() if client else without)
    session.close()

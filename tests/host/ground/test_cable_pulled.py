import shutil
from pathlib import Path
from typing import Any

import pytest

from cubestack.host.ground.session import TargetSession
from cubestack.host.targets import open_target
from cubestack.host.transport.streams import SerialTransport

from .cable import cable
from .conftest import SOON_S


@pytest.mark.skipif(shutil.which("socat") is None, reason="no socat")
@pytest.mark.parametrize("reopens", [True, False])
def test_serial_line_recovers_from_an_unplugged_cable(
    tmp_path: Path, uart: Any, reopens: bool
) -> None:
    ours, theirs = tmp_path / "ours", tmp_path / "theirs"
    with cable(ours, theirs, uart):
        target = open_target(str(ours), "cubestar")
        assert isinstance(target.line, SerialTransport)
        target.line.reopens = reopens
        session = TargetSession(target)
        assert "error" not in session.read(["Identification"]).result(SOON_S)["Identification"]
    assert "error" in session.read(["Identification"]).result(SOON_S)["Identification"]
    assert "error" in session.read(["Identification"]).result(SOON_S)["Identification"]
    with cable(ours, theirs, uart):
        found = session.read(["Identification"]).result(SOON_S)["Identification"]
        assert ("error" in found) is not reopens
    assert session.link.failed >= 2
    session.close()

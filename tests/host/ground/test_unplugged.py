"""A page's serial line between two terminals: pulled, and put back."""

import shutil
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from cubestack.host.devices.targets import open_target
from cubestack.host.errors import PortClosedError
from cubestack.host.ground.desk import Desk
from cubestack.host.transport.streams import SerialTransport

from .conftest import SOON_S

BAUD = 57600


@contextmanager
def cable(ours: Path, theirs: Path, uart: Any) -> Iterator[None]:
    """Two terminals, and a node at the far end."""
    ends = [f"pty,raw,echo=0,link={end}" for end in (ours, theirs)]
    with subprocess.Popen(["socat", "-d", "-d", *ends], stderr=subprocess.PIPE) as process:
        assert process.stderr is not None
        assert any(b"data transfer loop" in line for line in process.stderr)
        far = SerialTransport(str(theirs), BAUD)

        def serve() -> None:
            with suppress(PortClosedError):
                while True:
                    uart.write(far.read(1000, SOON_S))
                    far.write(uart.read(1000, 0.0))

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield
        finally:
            process.terminate()
            process.wait()
            thread.join(SOON_S)
            far.close()


@pytest.mark.skipif(shutil.which("socat") is None, reason="no socat")
@pytest.mark.parametrize("reopens", [True, False])
def test_a_cable_is_pulled_and_put_back(tmp_path: Path, uart: Any, reopens: bool) -> None:
    ours, theirs = tmp_path / "ours", tmp_path / "theirs"
    with cable(ours, theirs, uart):
        target = open_target(str(ours), "cubestar")
        assert isinstance(target.line, SerialTransport)
        target.line.reopens = reopens
        desk = Desk(target)
        assert "error" not in desk.read(["Identification"]).result(SOON_S)["Identification"]
    assert "error" in desk.read(["Identification"]).result(SOON_S)["Identification"]
    assert "error" in desk.read(["Identification"]).result(SOON_S)["Identification"]
    with cable(ours, theirs, uart):
        found = desk.read(["Identification"]).result(SOON_S)["Identification"]
        assert ("error" in found) is not reopens
    assert desk.link.failed >= 2
    desk.close()

import struct
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import serial
from PIL import Image

from cubestack.emulator.scene.attitude import attitude_error_deg, quaternion_from_pointing
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.interface.aramis import INTERFACE, CatalogueState
from cubestack.host.cli.main import main
from cubestack.host.clients.aramis.client import Aramis
from cubestack.host.clients.i2c import I2cClient
from tests.system.conftest import Emulate, Open

POINTING_DEG = (84.0, -1.0, 20.0)
TRUTH = quaternion_from_pointing(*POINTING_DEG)


@pytest.fixture
def served(emulate: Emulate, tmp_path: Path) -> Iterator[Path]:
    """An emulator process of its own; the path of its port."""
    scene = 'kind = "sky"\nra_deg = {}\ndec_deg = {}\nroll_deg = {}\n'.format(*POINTING_DEG)
    (tmp_path / "sky.toml").write_text(scene)
    with emulate("--scene", "sky.toml", "--pty", "port", "--pace", "fast") as emulator:
        yield tmp_path / "port"
    assert emulator.process.returncode == 0


def test_attitude_over_plain_pyserial(served: Path) -> None:
    with serial.Serial(str(served), 57_600, timeout=30) as port:

        def command(*payload: int) -> None:
            port.write(bytes([0x1F, 0x7F, *payload, 0x1F, 0xFF]))
            assert port.read(5) == bytes.fromhex("1F7F 00 1FFF")
            deadline = time.monotonic() + 30
            while time.monotonic() < deadline:
                port.write(bytes.fromhex("1F7F 83 1FFF"))
                if port.read_until(b"\x1f\xff")[2] == 1:
                    return
            raise AssertionError("never done")

        command(1)
        command(4)
        port.write(bytes.fromhex("1F7F 86 1FFF"))
        answer = port.read_until(b"\x1f\xff")[2:-2].replace(b"\x1f\x1f", b"\x1f")
    assert answer[32:36] == bytes([1, 1, 0, 1])  # outcome, reason, mode, valid
    cross, roll = attitude_error_deg(np.array(struct.unpack_from("<4f", answer)), TRUTH)
    assert cross < 0.01
    assert abs(roll) < 0.05


def test_attitude_is_measured_over_i2c(session: Open) -> None:
    with session(SkyScene(TRUTH)) as opened:
        bus = opened.board.i2c()
        bus.wait(0.1)
        aramis = Aramis(I2cClient(bus, INTERFACE, 0x1D, wait=bus.wait))
        assert aramis.activate() is CatalogueState.GOOD
        found = aramis.measure()
        assert found.valid
        assert attitude_error_deg(found.quaternion, TRUTH)[0] < 0.01


@pytest.mark.slow
def test_aramis_demo_writes_its_images(tmp_path: Path) -> None:
    assert main(["demo", "aramis", "--out", str(tmp_path)]) == 0
    for name in ("aramis-raw.png", "aramis-stars.png"):
        with Image.open(tmp_path / name) as picture:
            assert picture.size >= (1280, 1024)

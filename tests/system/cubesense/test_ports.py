import re
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import serial
from smbus2 import i2c_msg

from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubesense.codes import Camera, DetectResult
from cubestack.firmware_model.interface.cubesense.registers import REGISTERS
from cubestack.host.clients.cubesense.client import CubeSense
from cubestack.host.clients.cubesense.download import ServicePortClient
from cubestack.host.clients.i2c import I2cClient
from cubestack.host.clients.registers import RegisterClient
from cubestack.host.targets import open_target
from tests.system.conftest import ROOT, Emulate, Open, Served

from .conftest import NADIR_DEG, SUN_DEG, check_right, sent


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Path of the node port of an emulator process; tests share its settings."""
    folder = tmp_path_factory.mktemp("served")
    (folder / "scene.toml").write_text(
        f'kind = "earth-sun"\nsun_deg = {list(SUN_DEG)}\nnadir_deg = {list(NADIR_DEG)}\n'
    )
    options = ["--scene", "scene.toml", "--pty", "ttyCUBESENSE", "--pace", "fast"]
    with Served(["cubesense", *options], folder) as emulator:
        yield folder / "ttyCUBESENSE"
    assert emulator.process.returncode == 0


def test_documented_bench_client_downloads_the_nadir_image(
    served: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (ROOT / "docs" / "sensors" / "protocols-cubesense.md").read_text(encoding="utf-8")
    client = text.split("```python\n")[1].split("```")[0]
    timeout_s = re.search(r"timeout=(\d+)", client)
    assert timeout_s is not None
    assert int(timeout_s[1]) > 307_200 * 10 / 115_200  # on a line at its real pace
    monkeypatch.chdir(served.parent)
    exec(compile(client, "client.py", "exec"), {})
    header, data = Path("nadir.pgm").read_bytes().split(b"\n", 1)
    assert header == b"P5 640 480 255"
    picture = np.frombuffer(data, np.uint8).reshape(480, 640)
    assert 34 <= np.median(picture) <= 160
    assert picture[236 + 36, 371 - 24] > 100  # the Earth
    assert picture[5, 5] < 50


def test_serial_line_answers_node_protocol_with_escaped_bytes(served: Path) -> None:
    """Escaped bytes occur in an exposure of 0x1F1F."""
    with serial.Serial(str(served), 57_600, timeout=60) as port:
        port.write(bytes.fromhex("1F7F 80 1FFF"))
        answer = port.read_until(b"\x1f\xff")
        assert answer.startswith(b"\x1f\x7f")
        assert answer[3] == 2  # interface version
        port.write(bytes.fromhex("1F7F 14 00 00 1FFF"))
        assert port.read(5) == bytes.fromhex("1F7F 00 1FFF")
        deadline, detect = time.monotonic() + 20, 2
        while detect == 2 and time.monotonic() < deadline:
            port.write(bytes.fromhex("1F7F 94 1FFF"))
            result = port.read_until(b"\x1f\xff")
            detect = result[-3]
        assert detect == 7
        assert np.frombuffer(result[2:-4], "<i2") / 100 == pytest.approx(SUN_DEG, abs=0.1)
        port.write(bytes.fromhex("1F7F 2D 1F1F 1F1F 1F1F 8080 1FFF"))
        assert port.read(5) == bytes.fromhex("1F7F 00 1FFF")
        # Threshold 225 and 70, sun: auto 0, exposure 1, gain 0, blue, red; nadir as it was sent.
        wanted, answer = "1f7fe146000100008080001f1f1f1f1f1f80801fff", ""
        deadline = time.monotonic() + 20
        while answer != wanted and time.monotonic() < deadline:  # the command waits in the queue
            port.write(bytes.fromhex("1F7F A8 1FFF"))
            answer = port.read_until(b"\x1f\xff").hex()
        assert answer == wanted


@pytest.mark.slow
def test_registers_are_accessible_on_the_backup_uart(emulate: Emulate, tmp_path: Path) -> None:
    tty = tmp_path / "tty"
    with emulate("--uart", "registers", "--pty", "tty", "--pace", "fast"):
        with serial.Serial(str(tty), 115_200, timeout=60) as port:

            def read(address: int, count: int) -> bytes:
                port.write(bytes([0x39, address]))
                return port.read(count)

            assert read(0x00, 1) == b"\xe1"
            port.write(b"\x38\x00\xdc")
            assert read(0x00, 1) == b"\xdc"
            port.write(b"\x38\x10\x03")
            deadline = time.monotonic() + 20
            while (detect := read(0x29, 1)[0]) == DetectResult.PENDING:
                assert time.monotonic() < deadline
            assert detect == DetectResult.SUCCESS
            centre = np.frombuffer(read(0x48, 2) + read(0x49, 2), ">i2") / 100 / 2.9
            assert centre == pytest.approx((-8, 12), abs=0.5)
            port.write(b"\x38\x12\x01")
        target = open_target(str(tty), "cubesense", backup=True)
        assert target.registers is not None
        assert target.registers.read("SUN_THRESHOLD") == 220
        data = target.registers.read_stream("IMAGE")
        target.close()
    picture = np.frombuffer(data, np.uint8).reshape(480, 640)
    assert picture[236 + 36, 371 - 24] > 100  # the Earth
    assert picture[5, 5] < 50


def test_register_uart_leaves_the_node_protocol_to_i2c(ready: Open) -> None:
    with ready(uart="registers") as opened:  # the client's node protocol is on I2C then
        assert opened.client.capture_and_detect(Camera.SUN).detected
    target = open_target("emulated:cubesense", options={"uart": "registers"})
    assert target.registers is not None
    assert target.line is not None
    assert target.registers.read("SUN_THRESHOLD") == 225
    target.node.command("DetectionThreshold1", Threshold=99)
    target.node.pause(0.01)
    target.line.write(b"\x39\x00")
    assert target.line.read(9, 0.1) == b"\x63"
    target.close()


@pytest.mark.slow
def test_bench_download_equals_the_camera_image(ready: Open) -> None:
    with ready() as opened:
        line = opened.board.serial("bench_uart")
        read = line.read

        def read_later(max_bytes: int, timeout_s: float) -> bytes:
            opened.wait(0.05)  # many bytes at once are quicker
            return read(max_bytes, timeout_s)

        line.read = read_later
        bench = ServicePortClient(line)
        for camera in Camera:
            bench.take(camera)
            np.testing.assert_array_equal(bench.download(camera), sent(opened, camera))


def test_both_i2c_protocols_can_measure(ready: Open) -> None:
    with ready() as opened:
        bus = opened.board.i2c()
        node = CubeSense(I2cClient(bus, INTERFACE, wait=bus.wait))
        assert node.capture_and_detect(Camera.SUN).detected
        registers = RegisterClient(bus, REGISTERS, wait=bus.wait)
        registers.write("MEASURE", "NADIR_SRAM2")
        bus.wait(0.5)
        angles = [float(registers.read(f"NADIR_{axis}")) / 2.9 for axis in "XY"]
        assert angles == pytest.approx(NADIR_DEG, abs=0.1)
        check_right(node.result(Camera.NADIR))


@pytest.mark.slow
def test_image_register_streams_the_image(ready: Open) -> None:
    with ready() as opened:
        bus = opened.board.i2c()
        registers = RegisterClient(bus, REGISTERS, wait=bus.wait)
        registers.write("CAPTURE", "NADIR_SRAM2")
        bus.wait(0.2)
        registers.write("IMAGE_SRAM", "SRAM2")
        head = i2c_msg.read(0x1C, 4 * 640)
        bus.i2c_rdwr(i2c_msg.write(0x1C, [REGISTERS["IMAGE"].address]), head)
        assert bytes(head) == sent(opened, Camera.NADIR)[:4].tobytes()

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from cubestack.firmware_model.formats.i2c_socket import socket_path
from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.host.devices.registry import device_names, devices
from cubestack.host.targets import open_target
from tests.system.conftest import COMMAND, Served
from tests.tiers import quick

BUS = 16 + os.getpid() % 200
ADDRESSES = [device.interface.i2c_address for device in devices()]
READ_ALL = (
    "import smbus2\n"
    f"bus = smbus2.SMBus({BUS})\n"
    f"print(*(bus.read_byte_data(node, 0x80) for node in {ADDRESSES}))\n"
)


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """`emulate` with all devices and a socket folder of its own."""
    folder = tmp_path_factory.mktemp("run", numbered=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", str(folder))
        patch.delenv("CUBESTACK_I2C_SOCKET", raising=False)
        with Served([*device_names(), "--i2c", str(BUS)], folder, last="--bus"):
            assert socket_path(BUS).exists()
            yield


@pytest.mark.parametrize("route", quick(["seccomp", "preload"], 1))
def test_guest_program_finds_every_device_on_a_shared_bus(served: None, route: str) -> None:
    run = [*COMMAND, "run", "--bus", str(BUS), "--attach", "--route", route, "--"]
    probe = subprocess.run([*run, "true"], capture_output=True, text=True, timeout=60)
    if probe.returncode != 0:
        pytest.skip(f"no {route} route here: {probe.stderr.strip()}")
    program = [*run, sys.executable, "-c", READ_ALL]
    outcome = subprocess.run(program, capture_output=True, text=True, timeout=60)
    assert outcome.returncode == 0, outcome.stderr
    assert len(outcome.stdout.split()) == len(ADDRESSES)


@pytest.mark.skipif(Path(f"/dev/i2c-{BUS}").exists(), reason="a real bus of that number")
def test_i2c_target_without_a_device_file_is_emulated(served: None) -> None:
    target = open_target(f"i2c:{BUS}:{INTERFACE.i2c_address:#04x}")
    try:
        assert target.interface is INTERFACE
        assert target.node.telemetry("Identification")
    finally:
        target.close()

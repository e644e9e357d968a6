import argparse
import errno
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from types import SimpleNamespace

import pytest

from cubestack.emulator.boards.contract import SerialLine
from cubestack.emulator.bus.i2c import I2cMessage
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.ports.endpoint import PortError
from cubestack.emulator.sim.virtual_time import Kernel
from cubestack.host.cli import run
from cubestack.host.cli.ports import add_port_arguments, open_ports
from cubestack.host.devices.registry import device


@pytest.fixture
def opened():
    return emulated("CubeSense", ("node protocol", ""), ("bench protocol", ".bench"))


def emulated(title: str, *lines: tuple[str, str]) -> SimpleNamespace:
    """A stub of a powered-up device with serial lines."""
    kernel = Kernel()
    return SimpleNamespace(
        device=SimpleNamespace(title=title),
        board=SimpleNamespace(
            lines=[
                SerialLine(name, name, suffix, Uart(kernel, 9600, lambda _b: None, lambda: None,
                                                    silence_bytes=9))
                for name, suffix in lines
            ]
        ),
    )  # fmt: skip


@pytest.fixture
def ports(opened, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str, devices: Sequence[SimpleNamespace] = (opened,)) -> list[str]:
        parser = argparse.ArgumentParser(exit_on_error=False)
        add_port_arguments(parser)
        with ExitStack() as stack:
            served = open_ports(parser.parse_args(arguments), devices, stack)
            return [port.name for _, _, port in served]

    return call


def test_pty_names_default_to_the_device_or_follow_the_option(ports, opened):
    assert ports() == ["ttyCUBESENSE", "ttyCUBESENSE.bench"]
    assert ports("--pty", "y") == ["y", "y.bench"]
    devices = [emulated("CubeStar", ("node protocol", "")), opened]
    names = ["x_CUBESTAR", "x_CUBESENSE", "x_CUBESENSE.bench"]  # the given name comes before theirs
    assert ports("--pty", "x_", devices=devices) == names


@pytest.mark.parametrize("kind", ["tcp", "rfc2217"])
def test_port_0_opens_a_free_tcp_port_per_device(ports, kind):
    names = ports(f"--{kind}", "0")
    assert len(set(names)) == 2
    assert all(name.startswith(f"{kind}://127.0.0.1:") for name in names)


@pytest.mark.parametrize("devices", [1, 2])
def test_rejects_a_port_range_that_is_too_small(ports, opened, devices):
    with pytest.raises(ValueError, match=f"CubeSense needs {2 * devices} ports, 65535 and up"):
        ports("--rfc2217", "65535", devices=[opened] * devices)


@pytest.mark.parametrize("kind", ["tcp", "rfc2217"])
def test_remote_listening_needs_allow_remote(ports, kind):
    with pytest.raises(PortError, match=r"0\.0\.0\.0 is open to other machines"):
        ports(f"--{kind}", "0", "--listen", "0.0.0.0")
    assert len(ports(f"--{kind}", "0", "--listen", "0.0.0.0", "--allow-remote")) == 2


def test_strict_line_rejects_tcp(ports):
    with pytest.raises(ValueError, match="a TCP client sets no baud rate; use --pty or --rfc2217"):
        ports("--tcp", "0", "--strict-line")
    assert ports("--strict-line") == ports()


pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="/dev/i2c-N is of Linux")


@pytest.mark.parametrize("names", [("aramis",), ("cubestar", "aramis")])
def test_all_requested_devices_share_one_bus(names: tuple[str, ...]) -> None:
    parser = argparse.ArgumentParser()
    run.add_arguments(parser)
    asked = [word for name in names for word in ("--device", name)]
    results = {}
    with ExitStack() as stack:
        bus = run._emulated(parser.parse_args(["--quiet", *asked, "--", "true"]), stack)
        assert bus.adapter is not None
        for name in ("cubestar", "aramis"):
            told: list[int] = []
            address = device(name).interface.i2c_address
            bus.adapter.submit([I2cMessage(address, read=1)], told.append)
            while not told:
                bus.kernel.step()
            results[name] = told[0]
    assert results == {name: 0 if name in names else -errno.ENXIO for name in results}

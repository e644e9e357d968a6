import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.emulator.boards import debugging
from cubestack.emulator.iss.insight.observer import Observer
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.ports.gdb import GdbEndpoint
from cubestack.emulator.scene.sky import SkyScene
from cubestack.firmware_model.interface.codec.switches import Switches
from cubestack.firmware_model.interface.cubestar.switches import CubeStarSwitches
from cubestack.host.devices.registry import device as registered
from cubestack.host.emulation.emulated import open_device, power_up
from cubestack.host.emulation.records import InsightFiles, open_gdb
from cubestack.host.experiments.measure import measure
from cubestack.host.output import Outputs
from tests.emulator.iss.efm32gg.bench import MS, Bench

ASK = bytes([0x1F, 0x7F, 128, 0x1F, 0xFF])

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


@pytest.fixture
def device() -> Iterator[Any]:
    with open_device("cubestar", seed=4) as device:
        yield device


def test_device_serial_port_works_in_virtual_time(device: Any) -> None:
    with device.serial(timeout=0.5) as port:
        assert port.write(ASK) == len(ASK)
        assert port.read_until(b"\x1f\xff", size=3)[:2] == b"\x1f\x7f"
        began = device.time_s
        assert port.read(1000)[-2:] == b"\x1f\xff"
        assert device.time_s - began == pytest.approx(0.5, abs=1e-9)
        port.write(ASK)
        assert port.in_waiting == 0
        device.wait(0.1)
        assert port.in_waiting == 12
        port.reset_input_buffer()
        assert port.in_waiting == 0
    assert not port.is_open


def test_client_and_i2c_reach_the_same_device(device: Any) -> None:
    assert device.client.client.telemetry("Identification")["NodeType"] == 5
    port = device.serial()
    port.write(ASK)
    assert port.read(2) == b"\x1f\x7f"
    assert device.client.client.telemetry("Identification")["NodeType"] == 5
    with device.smbus() as bus:
        assert bus.read_i2c_block_data(0x1A, 128, 1) == [5]


def test_scene_can_be_changed(device: Any, tmp_path: Any) -> None:
    device.scene = SkyScene.pointing(10, 60)
    assert device.client.capture_and_process().name == "CALCULATED"
    assert device.client.attitude().ra_deg == pytest.approx(10, abs=0.05)
    path = tmp_path / "none.toml"
    with pytest.raises(ValueError, match=r"none\.toml"):
        device.scene = path


def test_hanging_program_is_killed(device: Any) -> None:
    with pytest.raises(subprocess.TimeoutExpired):
        device.run(sys.executable, "-c", "import time; time.sleep(60)", timeout_s=0.3)
    done = device.run(sys.executable, "-c", "print('{port}')")
    assert done.stdout.endswith("/ttyCUBESTAR\n")


def test_missing_program_raises(device: Any) -> None:
    with pytest.raises(FileNotFoundError):
        device.run("/no/such/program")
    assert device.client.client.telemetry("Identification")["NodeType"] == 5


SKY = 'kind = "sky"\nra_deg = 10\ndec_deg = 20\n'


def test_scene_file_sets_the_profile_unless_given(tmp_path: Path) -> None:
    path = tmp_path / "sky.toml"
    path.write_text(SKY + 'profile = "extended"\nset = "tracking=nearest"\n')
    said = {"profile": "extended", "set": "tracking=nearest"}
    cubestar, given = registered("cubestar"), []

    def open_board(*scene: Any, switches: Switches, **options: Any) -> Any:
        given.append(switches)
        return cubestar.open_board(*scene, switches=switches, **options)

    watched = replace(cubestar, open_board=open_board)
    for options in ({}, {"profile": "published"}, {"set": "voting=confirmed"}):
        with power_up(watched, path, **options) as device:
            assert given.pop() == CubeStarSwitches.of(*(said | options).values())
            assert device.chosen == said | options
            other = tmp_path / "other.toml"
            other.write_text(SKY + 'profile = "best"\n')
            with pytest.raises(ValueError, match=r"other\.toml: profile of cubestar must be"):
                device.scene = other
            other.write_text(SKY + 'set = "tracking=verified"\n')
            with pytest.raises(ValueError, match=r"other\.toml: set can only be chosen"):
                device.scene = other
            other.write_text(SKY + f'profile = "{device.chosen["profile"]}"\n')
            device.scene = other


@pytest.mark.parametrize(
    ("device", "line", "text"),
    [
        ("cubestar", 'profile = "best"', "profile of cubestar must be one of published, extended"),
        ("cubestar", "profile = 3", "profile must be text, not 3"),
        ("cubestar", 'set = "far"', "set: 'far' is not SWITCH=VALUE; switches: voting, weights"),
        ("cubestar", 'set = "voting=far"', "switch voting must be one of algorithm-2, confirmed"),
        ("aramis", 'set = "voting=confirmed"', "set: no switch 'voting'; switches: belief"),
    ],
)
def test_rejects_invalid_profiles_in_a_scene_file(
    device: str, line: str, text: str, tmp_path: Path
) -> None:
    path = tmp_path / "sky.toml"
    path.write_text(SKY + line)
    for open_it in (open_device, lambda name, scene: measure(name, scene=scene)):
        with pytest.raises(ValueError, match=r"sky\.toml: ") as refused:
            open_it(device, path)
        assert text in str(refused.value)


def test_device_without_switches_rejects_a_profile(tmp_path: Path) -> None:
    cubestar = registered("cubestar")
    plain = replace(cubestar, interface=replace(cubestar.interface, switches=Switches))
    (tmp_path / "sky.toml").write_text(SKY + 'profile = "extended"')
    with pytest.raises(ValueError, match=r"sky\.toml: profile is .* of .*aramis, not of cubestar"):
        power_up(plain, tmp_path / "sky.toml")


@pytest.mark.parametrize("count", [1, 2, 3])
def test_profile_sums_the_cycles_of_all_devices(tmp_path: Path, count: int) -> None:
    path, cycles = tmp_path / "profile", 0
    with Outputs() as stack:
        watch = InsightFiles(profile=path).open(stack)
        for number in range(1, count + 1):
            bench = Bench()
            observer = Observer(bench.machine, Symbols(None))
            before = bench.machine.cycles
            emulated: Any = SimpleNamespace(
                board=SimpleNamespace(insight=SimpleNamespace(observer=observer))
            )
            watch(emulated)
            bench.run_for(number * MS)
            cycles += bench.machine.cycles - before
            observer.close()
    assert int(path.read_text().split("totals: ")[1]) == pytest.approx(cycles, abs=100)


def test_closing_a_device_closes_its_debugger(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        debugging, "open_debugger", lambda _board, port, **_: GdbEndpoint(port, target)
    )
    target: Any = SimpleNamespace()
    emulated: Any = SimpleNamespace(board=SimpleNamespace(insight=object(), on_close=[]))
    endpoint = open_gdb(emulated, 0, wait=False)
    socket.create_connection(endpoint.address).close()
    for act in emulated.board.on_close:
        act()
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(endpoint.address)

import json
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path

import pytest

from cubestack.emulator.i2cdev.adapter import I2cAdapter
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.ports.serial_port import SerialPort
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.formats.recording import load_recording
from cubestack.host.emulation.emulated import AnyEmulated, open_device
from cubestack.host.emulation.history import History
from cubestack.host.output import Outputs
from cubestack.host.recording.setups import emulated_setup

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


Make = Callable[..., tuple[list[AnyEmulated], History]]


@pytest.fixture
def make(tmp_path: Path) -> Iterator[Make]:
    with Outputs() as stack:

        def recorded(*names: str, scene: Path | None = None) -> tuple[list[AnyEmulated], History]:
            devices: list[AnyEmulated] = []
            for name in names:
                beside = devices[0] if devices else None
                devices.append(open_device(name, scene, seed=4, beside=beside))
            files = [tmp_path / f"{name}.rec" for name in names]
            past = History(devices, [emulated_setup(4, scene)] * len(names), files)
            stack.callback(past.close)
            return devices, past

        yield recorded


def talk(device: AnyEmulated, number: int) -> None:
    client = device.client.client
    client.telemetry("Identification")
    client.command("DetectionThreshold1", Threshold=number)
    client.telemetry("Configuration")


def after(path: Path, time_ps: int) -> list[object]:
    events = load_recording(path).events
    return [event for event in events if event.time_ps > time_ps]


def test_rerun_is_identical(make):
    devices, past = make("cubesense")
    kernel = devices[0].board.kernel
    talk(devices[0], 7)
    (controls,) = past.controls()
    controls.fault(["latch-up", "SRAM1", "at_s=20"])
    controls.switch("sun_camera", False)
    kernel.advance_to(10 * PS_PER_S)
    then = dict(devices[0].board.probes()), devices[0].board.power.current_ma()
    kernel.advance_to(25 * PS_PER_S)
    talk(devices[0], 8)
    told = [str(event) for event in devices[0].faults.log]
    before = past.file(0).read_text()
    expected = after(past.file(0), 10 * PS_PER_S)
    old = devices[0]
    past.begin_again(10 * PS_PER_S)
    assert past.again
    assert kernel.now == 0
    kernel.advance_to(10 * PS_PER_S)
    past.arrive()
    new = devices[0]
    assert new is not old
    assert (dict(new.board.probes()), new.board.power.current_ma()) == then
    kernel.advance_to(25 * PS_PER_S)
    talk(new, 8)
    assert [str(event) for event in new.faults.log] == told
    assert after(past.file(0), 10 * PS_PER_S) == expected
    assert sorted(past.file(0).read_text().splitlines()) == sorted(before.splitlines())


def test_later_actions_are_not_repeated(make):
    devices, past = make("cubesense")
    kernel = devices[0].board.kernel
    talk(devices[0], 7)
    kernel.advance_to(10 * PS_PER_S)
    (controls,) = past.controls()
    controls.fault(["latch-up"])
    kernel.advance_to(12 * PS_PER_S)
    past.begin_again(9 * PS_PER_S)
    kernel.advance_to(9 * PS_PER_S)
    past.arrive()
    kernel.advance_to(30 * PS_PER_S)
    assert not devices[0].faults.log
    assert devices[0].client.client.telemetry("Configuration")["Threshold1"] == 7


def test_going_back_can_stop_before_an_event(make):
    devices, past = make("cubesense")
    kernel = devices[0].board.kernel
    kernel.advance_to(5 * PS_PER_S)
    talk(devices[0], 7)
    kernel.advance_to(10 * PS_PER_S)
    past.begin_again(10 * PS_PER_S)
    kernel.advance_to(3 * PS_PER_S)
    past.arrive()
    kernel.advance_to(10 * PS_PER_S)
    assert devices[0].client.client.telemetry("Configuration")["Threshold1"] != 7


def test_devices_on_one_bus_go_back_together(make):
    devices, past = make("cubestar", "cubesense")
    kernel = devices[0].board.kernel
    kernel.advance_to(3 * PS_PER_S)
    identities = []
    for _ in range(2):
        bus = devices[1].smbus()
        identities.append([bus.read_i2c_block_data(address, 0x80, 8) for address in (0x1A, 0x1B)])
        end_ps = kernel.now
        expected = [after(past.file(number), 3 * PS_PER_S) for number in (0, 1)]
        past.begin_again(3 * PS_PER_S)
        kernel.advance_to(3 * PS_PER_S)
        past.arrive()
    assert identities[0] == identities[1]
    kernel.advance_to(end_ps)
    assert expected[0]
    assert expected[0] == expected[1]
    assert not after(past.file(0), 3 * PS_PER_S)


class FakeClient(SerialPort):
    """A port whose client writes ``writes`` and stores answers in ``got``."""

    name = "fake"

    def __init__(self, uart):
        super().__init__(uart)
        self.writes, self.got = bytearray(), bytearray()

    def _find_client(self):
        return self

    def _read(self, max_bytes):
        data = bytes(self.writes[:max_bytes])
        del self.writes[:max_bytes]
        return data

    def _write(self, data):
        self.got += data
        return len(data)


def test_ports_pause_and_reconnect_to_the_new_device(make):
    devices, past = make("cubesense")
    kernel = devices[0].board.kernel
    port = FakeClient(devices[0].board.uart)
    past.ports = [(0, "uart", port)]
    past.bus = I2cAdapter(kernel, devices[0].board.i2c_bus)

    def serve(end_ps):
        while kernel.now < end_ps:
            kernel.advance_to(kernel.now + PS_PER_S // 1000)
            port.exchange(kernel.now)

    ask = bytes([0x1F, 0x7F, 0x80, 0x1F, 0xFF])
    serve(2 * PS_PER_S)
    port.writes += ask
    serve(3 * PS_PER_S)
    answer = bytes(port.got)
    assert len(answer) > 8
    results = Future[int]()
    past.begin_again(2 * PS_PER_S)
    port.writes += ask
    past.bus.submit([], results.set_result)
    serve(2 * PS_PER_S)
    assert (bytes(port.got), bytes(port.writes), results.result(0) < 0) == (answer, ask, True)
    past.arrive()
    serve(3 * PS_PER_S)
    assert bytes(port.got) == 2 * answer


def test_invalid_recording_keeps_the_old_device(make, tmp_path):
    scene = tmp_path / "sun.toml"
    scene.write_text('kind = "earth-sun"\n')
    devices, past = make("cubesense", scene=scene)
    device = devices[0]
    path = past.file(0)
    header, *rest = path.read_text().splitlines()
    content = json.loads(header)
    content["setup"]["scene"] = {"name": "gone.toml", "text": "nonsense = 1\n"}
    path.write_text("\n".join([json.dumps(content), *rest]) + "\n")
    with pytest.raises(ValueError, match=r"gone\.toml: kind must be"):
        past.begin_again(0)
    assert devices == [device]
    assert not past.again


def test_closed_recording_is_complete_and_final(make):
    devices, past = make("cubesense")
    path = past.file(0)
    talk(devices[0], 7)
    past.close()
    ended = path.read_bytes()
    said, _ = load_recording(path).sent("uart", "device")
    assert said.endswith(bytes([0x1F, 0xFF]))  # the last answer is whole
    talk(devices[0], 8)
    assert path.read_bytes() == ended

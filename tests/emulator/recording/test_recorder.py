"""Recordings of small devices: an echo on a line, a memory on the bus."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.emulator.bus.i2c import I2cBus, I2cError, I2cMessage
from cubestack.emulator.bus.line_format import LineFormat
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.recording.recorder import Recorder
from cubestack.emulator.recording.replay import Replay
from cubestack.emulator.sim.virtual_time import PS_PER_MS, Kernel
from cubestack.firmware_model.formats.recording import Control, Recording, load_recording
from cubestack.firmware_model.interface.cubesense import INTERFACE

from ..bus.ends import Memory


class Pointed(Memory):
    """Answers reads with the numbers after the last byte that was written."""

    def i2c_write(self, byte: int) -> bool:
        self.next = byte + 1
        return super().i2c_write(byte)


class Device:
    def __init__(self, answer: int = 1) -> None:
        self.kernel = Kernel()
        self.uart = Uart(self.kernel, 57_600, self._on_byte, lambda: None, silence_bytes=10)
        self.bus = I2cBus(self.kernel)
        self.bus.attach(0x1B, Pointed(refuse=0xEE))
        self._answer = answer

    def _on_byte(self, byte: int) -> None:
        self.uart.send(bytes([(byte + self._answer) % 256]))

    def replay(self, recording: Recording) -> list[str]:
        return Replay(recording, self.kernel, {"uart": self.uart}, self.bus).run(INTERFACE)


@contextmanager
def recorded(path: Path, device: Device) -> Iterator[Recorder]:
    uarts = {"uart": device.uart}
    with path.open("w") as stream, closing(Recorder(stream, "cubesense", uarts)) as recorder:
        recorder.listen(device.bus)
        yield recorder


def record(path: Path, writes: list[tuple[int, bytes]], transfers: int = 2) -> Recording:
    device = Device()

    def talk():
        for _ in range(transfers):
            messages = [I2cMessage(0x1B, bytearray(b"\x80")), I2cMessage(0x1B, read=3)]
            yield device.kernel.process(device.bus.transfer(messages))
            yield device.kernel.timeout(PS_PER_MS)

    with recorded(path, device):
        device.kernel.process(talk())
        for pause_ps, data in writes:
            device.kernel.advance_to(device.kernel.now + pause_ps)
            device.uart.host_writes(data)
        device.kernel.run()
    return load_recording(path)


WRITES = st.lists(st.tuples(st.integers(0, 10**10), st.binary(max_size=300)), max_size=4)


@given(WRITES)
def test_replay_on_the_same_device_has_no_differences(tmp_path_factory, writes):
    recording = record(tmp_path_factory.getbasetemp() / "a.rec", writes)
    sent = b"".join(data for _, data in writes)
    assert recording.sent("uart", "host")[0] == sent
    assert recording.sent("uart", "device")[0] == bytes((byte + 1) % 256 for byte in sent)
    assert Device().replay(recording) == []


def test_recorded_times_are_those_on_the_wire(tmp_path):
    byte_ps = LineFormat(57_600).character_ps
    recording = record(tmp_path / "a.rec", [(5, b"ab"), (0, b"c")])
    assert recording.sent("uart", "host")[1] == [5 + i * byte_ps for i in range(3)]
    assert recording.sent("uart", "device")[1] == [5 + (1 + i) * byte_ps for i in range(3)]
    assert recording.transfers[0].messages[1].data == b"\x81\x82\x83"


def test_bytes_without_a_gap_are_one_event(tmp_path):
    device, path = Device(), tmp_path / "a.rec"
    device.uart.on_byte = lambda _byte: None
    with recorded(path, device):
        device.uart.host_writes(b"abc")
        device.kernel.run()
        device.kernel.advance_to(device.kernel.now + 5)
        device.uart.host_writes(b"de")
        device.kernel.run()
    assert [event.data for event in load_recording(path).line("uart")] == [b"abc", b"de"]


def test_replay_reports_different_answers(tmp_path):
    recording = record(tmp_path / "a.rec", [(0, b"\x1f\x7f\x80\x1f\xff")])
    differences = Device(answer=2).replay(recording)
    assert len(differences) == 1
    assert differences[0].startswith("uart: byte 0 from the device")
    assert differences[0].endswith("0x21, recorded 0x20")


def test_replay_reports_lost_i2c_transfers(tmp_path):
    recording = record(tmp_path / "a.rec", [])
    device = Device()
    device.bus._targets.clear()
    assert device.replay(recording) == [
        "i2c: byte 0 read at address 0x1b, telemetry "
        "Identification, field NodeType: nothing, recorded 0x81"
    ]


def test_replay_reports_a_delayed_answer(tmp_path):
    recording = record(tmp_path / "a.rec", [(0, b"a")])
    device = Device()
    device.uart.on_byte = lambda byte: device.kernel.timeout(PS_PER_MS).callbacks.append(
        lambda _event: device.uart.send(bytes([byte + 1]))
    )
    (difference,) = device.replay(recording)
    assert difference.endswith("same bytes, +1000.000 us in time")


def test_failed_transfer_is_recorded(tmp_path):
    device, path = Device(), tmp_path / "a.rec"
    transfer = device.bus.transfer([I2cMessage(0x1B, bytearray(b"\xee"))])
    with recorded(path, device), pytest.raises(I2cError):
        device.kernel.run(device.kernel.process(transfer))
    recording = load_recording(path)
    assert recording.transfers[0].errno == 5
    assert Device().replay(recording) == []
    other = Device()
    other.bus._targets.clear()  # nobody there: 6, ENXIO
    (difference,) = other.replay(recording)
    assert difference.endswith("errno 6, recorded 5")


def test_replay_rejects_a_recording_of_other_ports(tmp_path):
    recording = Recording("x.rec", "cubesense", {"bench_uart": 9600})
    device = Device()
    with pytest.raises(ValueError, match=r"x\.rec has port bench_uart, this device has uart"):
        device.replay(recording)


def test_framing_errors_are_recorded_and_replayed(tmp_path):
    device, path = Device(), tmp_path / "a.rec"
    with recorded(path, device):
        device.uart.host_writes(b"a")
        device.kernel.run()
        device.uart.host_form = LineFormat(57_600, parity="S")
        device.uart.host_writes(b"bc")
        device.kernel.run()
    assert '"error":"framing"' in path.read_text()
    again = Device()
    assert again.replay(load_recording(path)) == []
    assert again.uart.framing_errors == device.uart.framing_errors == 2


class Losing:
    """A line that loses every second byte to the device."""

    count = 0

    def to_host(self, data, first_ps, byte_ps, line) -> None:
        line(data, first_ps, byte_ps)

    def to_device(self, byte, start_ps, receive) -> None:
        self.count += 1
        if self.count % 2:
            receive(byte, start_ps)


def test_bytes_lost_by_a_fault_are_recorded_and_lost_in_replay(tmp_path):
    device, path = Device(), tmp_path / "a.rec"
    device.uart.fault_hook = Losing()
    with recorded(path, device):
        device.uart.host_writes(b"abcd")
        device.kernel.run()
    recording = load_recording(path)
    assert recording.sent("uart", "host")[0] == b"abcd"
    assert recording.sent("uart", "device")[0] == b"bd"
    again = Device()
    again.uart.fault_hook = Losing()
    assert again.replay(recording) == []
    assert len(Device().replay(recording)) == 1


def test_replay_repeats_recorded_actions(tmp_path):
    device, path = Device(), tmp_path / "a.rec"
    with recorded(path, device) as recorder:
        device.kernel.advance_to(PS_PER_MS)
        recorder.control(device.kernel.now, ("scene", "x.toml"), "text")
    recording = load_recording(path)
    again, done = Device(), []

    def act(control: Control) -> None:
        done.append((again.kernel.now, control))

    Replay(recording, again.kernel, {"uart": again.uart}, again.bus, act).run(INTERFACE)
    assert done == [(PS_PER_MS, Control(PS_PER_MS, ("scene", "x.toml"), "text"))]
    with pytest.raises(ValueError, match=r"a\.rec: command .scene x\.toml. is not supported here"):
        Device().replay(recording)

import logging

import numpy as np
import pytest

from cubestack.emulator.camera.ov7620.sccb import SccbSlave

from ..conftest import US, send


class Device:
    def __init__(self) -> None:
        self.written: list[tuple[int, int, int]] = []
        self.slave = SccbSlave(0x21, lambda *write: self.written.append(write))

    def send(self, data: bytes, now_ps: int = 0, step_ps: int = 3 * US) -> list[int]:
        return send(self.slave.on_pin, lambda: self.slave.sda, data, now_ps, step_ps)

    @property
    def registers(self) -> list[tuple[int, int]]:
        return [write[:2] for write in self.written]


@pytest.fixture
def device() -> Device:
    return Device()


def test_sccb_three_byte_message_writes_a_register(device: Device) -> None:
    expected = [(a, v) for a, v in np.random.default_rng(6).integers(0, 256, (50, 2)).tolist()]
    for address, value in expected:
        assert device.send(bytes([0x42, address, value])) == [0, 0, 0]
    assert device.registers == expected


def test_sccb_value_takes_effect_at_the_ninth_clock_of_its_byte(device: Device) -> None:
    device.send(bytes([0x42, 0x10, 0x5A]), step_ps=10 * US)
    # 4 steps of the start, 2 bytes of 27 steps, 8 bits of 3 steps, SDA released, SCL up.
    assert device.written[0][2] == (4 + 2 * 27 + 24 + 2) * 10 * US


@pytest.mark.parametrize("address", [0x40, 0x43, 0x00, 0xFF])
def test_sccb_camera_ignores_other_addresses_and_reads(device: Device, address: int) -> None:
    assert device.send(bytes([address, 0x10, 0x5A])) == [1, 1, 1]
    assert device.registers == []
    device.send(bytes([0x42, 0x10, 0x5A]))
    assert device.registers == [(0x10, 0x5A)]


def test_short_sccb_transmissions_write_nothing(device: Device) -> None:
    for data in (b"", b"\x42", b"\x42\x10"):
        assert device.send(data) == [0] * len(data)
    assert device.registers == []


def test_extra_sccb_bytes_are_logged_and_ignored(
    device: Device, caplog: pytest.LogCaptureFixture
) -> None:
    device.send(bytes([0x42, 0x10, 0x5A, 0x77]))
    assert device.registers == [(0x10, 0x5A)]
    assert caplog.messages == ["SCCB: ignored byte 0x77 after a register's value"]


def test_start_within_a_message_restarts_it(device: Device) -> None:
    pin = device.slave.on_pin
    for byte in (0x42, 0x10):
        for n in range(8):
            pin("SDA", byte >> (7 - n) & 1, 0)  # SCL is high at first: starts and stops
    device.send(bytes([0x42, 0x11, 0x01]))
    # Cut off after five bits of the value, by a stop.
    steps = [("SDA", 0), ("SCL", 0)]
    for n in range(9 + 5):
        steps += [("SDA", 0x4210 >> (15 - n) & 1), ("SCL", 1), ("SCL", 0)]
    steps += [("SDA", 0), ("SCL", 1), ("SDA", 1)]
    for number, (name, level) in enumerate(steps):
        pin(name, level, 10**9 + number * 3 * US)
    device.send(bytes([0x42, 0x12, 0x02]), now_ps=2 * 10**9)
    assert device.registers == [(0x11, 0x01), (0x12, 0x02)]


def test_line_is_released_after_each_ninth_bit(device: Device) -> None:
    lows: list[tuple[str, int]] = []

    def pin(name: str, level: int, now_ps: int) -> None:
        device.slave.on_pin(name, level, now_ps)
        if device.slave.sda == 0:
            lows.append((name, level))

    send(pin, lambda: device.slave.sda, bytes([0x42]))
    # From the fall after the eighth bit to the one after the ninth.
    assert lows == [("SCL", 0), ("SDA", 1), ("SCL", 1)]


def test_too_fast_clock_is_logged_once(device: Device, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        device.send(bytes([0x42, 0x10, 0x5A]), step_ps=700_000)
        assert not caplog.records  # 0.7 us high, 1.4 us low
        device.send(bytes([0x42, 0x10, 0x5B]), now_ps=10**9, step_ps=500_000)
    assert device.registers == [(0x10, 0x5A), (0x10, 0x5B)]
    message = "SCCB: SCL was low for only 1.00 us; at least 1.3 us are needed"
    assert caplog.messages == [message]


@pytest.mark.parametrize(
    ("low_ps", "high_ps", "told"),
    [
        (1_300_000, 600_000, []),
        (1_299_999, 600_000, ["low was 1.30, right 1.3"]),
        (1_300_000, 599_999, ["high was 0.60, right 0.6"]),
    ],
)
def test_sccb_reports_times_shorter_than_the_data_sheet_allows(
    device: Device, caplog: pytest.LogCaptureFixture, low_ps: int, high_ps: int, told: list[str]
) -> None:
    """I2C's fast mode: SCL low for 1.3 us, high for 0.6 us."""
    pin, now = device.slave.on_pin, 10**9
    pin("SDA", 0, now)
    for _ in range(2):
        pin("SCL", 0, now := now + high_ps)
        pin("SCL", 1, now := now + low_ps)
    heard = [record.args for record in caplog.records]
    assert [f"{a} was {b:.2f}, right {c:.1f}" for a, b, c in heard] == told


def test_sccb_slave_rejects_unknown_pins(device: Device) -> None:
    with pytest.raises(ValueError, match="has the pins SCL and SDA, not 'CLK'"):
        device.slave.on_pin("CLK", 1, 0)

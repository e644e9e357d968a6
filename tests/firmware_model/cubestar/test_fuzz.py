"""Nonsense on both buses: nothing breaks, and the next good message gets its answer."""

import numpy as np
import pytest

from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.cubestar import INTERFACE, AckError
from tests.tiers import quick

from .harness import Harness

UART_BYTES = 40_000
STREAM = INTERFACE.telecommand("StreamDownImage").id

short_and_long = pytest.mark.parametrize("count", quick([1_000, 10_000], 1))
"""Of frames, messages or transitions."""


def stays_sane(unit: Harness) -> None:
    unit.program.link.uart_silence()
    unit.run(until_us=unit.now_us + 200_000_000)  # what was accepted comes to its end
    unit.received()
    unit.command("StopLoop")
    unit.command("Reset")
    assert unit.telemetry("Identification")["InterfaceVersion"] == 3
    assert unit.i2c_read(1, 131) == b"\1"
    unit.command("ClearConfig", "CaptureAndProcess")
    assert unit.telemetry("AttitudeQuaternion")["Valid"]


@pytest.mark.parametrize("seed", range(2))
def test_random_uart_bytes_do_not_harm_the_node(lit: Harness, seed: int) -> None:
    rng = np.random.default_rng(seed)
    data = rng.integers(0, 256, UART_BYTES, dtype=np.uint8)
    # As likely as any other byte in one half of the noise, every third byte in the other.
    special = rng.choice(np.array([0x1F, 0x7F, 0xFF], np.uint8), UART_BYTES)
    data = np.where(rng.random(UART_BYTES) < 0.33 * seed, special, data)
    for start in range(0, UART_BYTES, 1000):
        lit.uart(data[start : start + 1000].tobytes())
        lit.run(until_us=lit.now_us + 1000 * 174)
    lit.program.link.uart_silence()
    assert lit.flags() >= {"UART_ProtocolError"}
    stays_sane(lit)


@short_and_long
def test_random_uart_frames_do_not_harm_the_node(lit: Harness, count: int) -> None:
    """Frames as they should be, with random IDs, lengths and parameters."""
    rng = np.random.default_rng(11)
    for _ in range(count):
        identifier = int(rng.integers(0, 256))
        message = INTERFACE.find(identifier)
        right = message.length if message is not None and identifier < 128 else 0
        length = right if rng.random() < 0.8 else int(rng.integers(0, 200))
        if identifier == STREAM:
            continue  # 90 s of unit time each
        answers = lit.uart(encode_frame(bytes([identifier]) + rng.bytes(length)))
        if identifier < 128:
            (answer,) = answers
            assert AckError(answer[0]) in AckError
        elif message is None:
            assert answers == []
        else:
            assert [len(answer) for answer in answers] == [message.length]
        lit.run(until_us=lit.now_us + int(rng.integers(0, 200_000)))
        assert not lit.received()
    stays_sane(lit)


@short_and_long
def test_random_i2c_messages_do_not_harm_the_node(lit: Harness, count: int) -> None:
    rng = np.random.default_rng(12)
    for _ in range(count):
        identifier = int(rng.integers(0, 256))
        if identifier == STREAM:
            continue
        match rng.integers(0, 4):
            case 0:
                lit.i2c_write(bytes([identifier]) + rng.bytes(int(rng.integers(0, 12))))
            case 1:
                lit.i2c_write(rng.bytes(int(rng.integers(0, 300))))
            case 2:
                lit.i2c_read(int(rng.integers(0, 300)), identifier)
            case 3:
                lit.i2c_read(int(rng.integers(0, 40)))
        lit.run(until_us=lit.now_us + int(rng.integers(0, 50_000)))
    assert lit.flags() >= {
        "I2C_WaitForIDReadRequestError",
        "I2C_TCMD_TooFewParm",
        "I2C_TCMD_TooManyparm",
        "TcmdIDError",
        "TlmIDError",
    }
    stays_sane(lit)


@short_and_long
def test_random_i2c_transitions_do_not_harm_the_node(lit: Harness, count: int) -> None:
    """Starts, bytes and stops in any order, as a disturbed bus may bring them."""
    rng = np.random.default_rng(13)
    for _ in range(count):
        link = lit.program.link
        match rng.integers(0, 5):
            case 0:
                link.i2c_start(bool(rng.integers(0, 2)))
            case 1 | 2:
                identifier = int(rng.integers(0, 256))
                link.i2c_write(identifier if identifier != STREAM else 0)
            case 3:
                assert 0 <= link.i2c_read() <= 255
            case 4:
                link.i2c_stop()
        lit.run(until_us=lit.now_us + int(rng.integers(0, 10_000)))
    lit.program.link.i2c_stop()
    stays_sane(lit)


def test_flood_of_frames_drops_whole_answers_when_the_uart_is_full(lit: Harness) -> None:
    flood = encode_frame(bytes([143])) + encode_frame(b"\x10") + encode_frame(b"\x80")
    answers = 0
    for _ in range(1500):
        answers += len(lit.uart(flood))  # none of them is cut short
        lit.backlog = min(lit.backlog + 120, 2048)
        lit.run(until_us=lit.now_us + 2_600)
    assert 3 <= answers < 4500
    lit.backlog = 0
    assert "UART_TcmdBufOfError" in lit.flags()
    stays_sane(lit)

import re

import numpy as np
import pytest

from cubestack.firmware_model.interface.codec.field import InterfaceError
from cubestack.firmware_model.interface.cubesense.registers import REGISTERS
from cubestack.host.clients.registers import RegisterClient, RegisterLine
from cubestack.host.errors import NoAnswerError

from ..conftest import Line, Slave


@pytest.fixture
def slave() -> Slave:
    return Slave()


@pytest.fixture
def client(slave: Slave) -> RegisterClient:
    return RegisterClient(slave, REGISTERS, wait=slave.waits.append)


def test_measurements_are_signed_big_endian(client: RegisterClient, slave: Slave) -> None:
    slave.content[REGISTERS["NADIR_X"].address] = bytes.fromhex("FB2E")
    slave.content[REGISTERS["SUN_Y"].address] = bytes.fromhex("04D2")
    assert client.read("nadir_x") == -12.34
    assert client.read("SUN_Y") == 12.34


def test_register_write_sends_address_and_one_byte(client: RegisterClient, slave: Slave) -> None:
    address = REGISTERS["NADIR_THRESHOLD"].address
    client.write("NADIR_THRESHOLD", 85)
    client.write("measure", "NADIR_SRAM1")
    assert slave.written == [bytes([address, 85]), bytes([REGISTERS["MEASURE"].address, 2])]
    assert client.read("NADIR_THRESHOLD") == 85


def test_image_is_read_in_chunks_and_restarts_after_a_failure(
    client: RegisterClient, slave: Slave
) -> None:
    picture = np.random.default_rng(2).integers(0, 256, 307_200, np.uint8).tobytes()
    slave.content[REGISTERS["IMAGE"].address] = picture
    seen: list[tuple[int, int]] = []
    assert client.read_stream("IMAGE", lambda *done: seen.append(done)) == picture
    assert (slave.longest, len(seen), seen[-1]) == (8192, 38, (307_200, 307_200))
    slave.failures = [slave.transfers + 7, slave.transfers + 20]
    assert client.read_stream("IMAGE") == picture
    assert len(slave.waits) == 2


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("SUN_TRESHOLD", 1, "no register 'SUN_TRESHOLD'; did you mean SUN_THRESHOLD?"),
        ("SUN_X", 1, "register SUN_X is read-only"),
        ("IMAGE", b"", "register IMAGE is read-only"),
        ("SUN_THRESHOLD", 256, "256 does not fit; u8 carries 0 to 255"),
        ("SUN_AUTO", 2, "register SUN_AUTO: 2 is out of range"),
        ("MEASURE", "MOON", "no choice 'MOON'"),
        ("MEASURE", 4, "register MEASURE: 4 is out of range"),
    ],
)
def test_unknown_names_and_values_are_not_sent(
    client: RegisterClient, slave: Slave, name: str, value: object, message: str
) -> None:
    with pytest.raises(InterfaceError, match=re.escape(message)):
        client.write(name, value)
    assert slave.transfers == 0


def test_write_only_register_cannot_be_read(client: RegisterClient) -> None:
    with pytest.raises(InterfaceError, match="register MEASURE is write-only"):
        client.read("MEASURE")


def test_reads_are_retried_and_writes_are_not(client: RegisterClient, slave: Slave) -> None:
    slave.content[0] = b"\x07"
    slave.failures = [0, 1]
    assert client.read("SUN_THRESHOLD") == 7
    slave.failures = [3]
    with pytest.raises(NoAnswerError, match=r"SUN_THRESHOLD not acknowledged .* 0x1c in 1 attempt"):
        client.write("SUN_THRESHOLD", 7)
    assert slave.written == []


def test_register_client_names_a_silent_address(slave: Slave) -> None:
    client = RegisterClient(slave, REGISTERS, 0x33, wait=slave.waits.append)
    with pytest.raises(NoAnswerError, match=r"register SUN_X .* address 0x33 in 3 attempts"):
        client.read("SUN_X")
    assert len(slave.waits) == 2


class Answering(Line):
    """Answers in pieces of 5000 bytes; the first ``failures`` answers are cut short."""

    def __init__(self, answer: bytes, failures: int = 0) -> None:
        super().__init__()
        self.answer, self.failures, self.written = answer, failures, b""
        self.chunk = 5000

    def write(self, data: bytes) -> None:
        self.written += data
        self.failures -= 1
        self.pending[:] = self.answer if self.failures < 0 else self.answer[:1]

    def close(self) -> None:
        raise AssertionError("the line stays its owner's")


def test_register_client_works_on_a_serial_line() -> None:
    picture = np.random.default_rng(2).integers(0, 256, 307_200, np.uint8).tobytes()
    line = Answering(picture, failures=1)
    client = RegisterClient(RegisterLine(line), REGISTERS, wait=lambda _s: None)
    assert client.read_stream("IMAGE") == picture
    assert line.written == bytes([0x39, 0x60]) * 2
    line.answer = bytes.fromhex("FB2E")
    assert client.read("nadir_x") == -12.34
    client.write("SUN_THRESHOLD", 85)
    assert line.written[4:] == bytes([0x39, REGISTERS["NADIR_X"].address, 0x38, 0, 85])
    assert (
        sum(line.silences) == 1.0
    )  # for the rest of the answer that failed; never before a request
    line.answer = b""
    with pytest.raises(NoAnswerError, match="register SUN_X not acknowledged at I2C address 0x1c"):
        client.read("SUN_X")

"""What is CubeStar's own of its link, with the whole program behind it."""

from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.cubestar import INTERFACE, AckError

from .harness import Harness

EXPOSURE = INTERFACE.telecommand("Exposure")
GOOD = bytes([EXPOSURE.id]) + EXPOSURE.pack(exposure=5)


def ack(error: AckError) -> list[bytes]:
    return [bytes([error])]


def exposure(unit: Harness) -> int:
    unit.run()
    return int(unit.telemetry("Exposure")["exposure"])


def test_counters_count_what_was_accepted_and_answered(unit: Harness) -> None:
    unit.uart(encode_frame(GOOD) + encode_frame(b"\x63") + encode_frame(b"\xfe"))
    unit.i2c_write(GOOD)
    unit.telemetry("IDMargin")
    values = unit.telemetry("ExtendedIdentification")
    assert (values["TcmdCount"], values["TlmCount"]) == (2, 1)
    assert unit.telemetry("ExtendedIdentification")["TlmCount"] == 2


def test_every_byte_value_comes_through(unit: Harness) -> None:
    data = bytes([0x1F, 0x7F, 0xFF, 0x1F, 0x1F, *range(123)])
    unit.command("UploadBlock", BlockNumber=0, Data=data)
    unit.command("ImageBlockSet", BlockNumber=0, BlockSize=2)
    assert unit.telemetry("ImageBlock")["Block"] == data


def test_idle_means_that_a_reset_would_cut_nothing_short(unit: Harness) -> None:
    link = unit.program.link
    assert link.idle
    link.uart_byte(0x1F)
    assert not link.idle
    link.uart_silence()
    assert link.idle
    link.i2c_start(False)
    assert not link.idle
    link.i2c_stop()
    assert link.idle
    unit.backlog = 1
    assert not link.idle
    unit.backlog = 0
    unit.send("Exposure")
    assert not link.idle
    unit.run()
    assert link.idle


def test_i2c_telecommand_and_acknowledge(unit: Harness) -> None:
    assert unit.i2c_write(GOOD) == len(GOOD)
    assert unit.i2c_read(1, 131) == b"\0"
    unit.run()
    assert unit.i2c_read(1, 131) == b"\1"
    assert exposure(unit) == 5
    assert unit.flags() == set()


def test_two_reads_of_one_transfer_go_on(unit: Harness) -> None:
    link = unit.program.link
    link.i2c_start(False)
    link.i2c_write(128)
    link.i2c_start(True)
    first = bytes(link.i2c_read() for _ in range(3))
    link.i2c_start(True)
    rest = bytes(link.i2c_read() for _ in range(5))
    link.i2c_stop()
    assert (first + rest)[:2] == bytes([5, 3])
    assert unit.i2c_read(8, 128)[:4] == (first + rest)[:4]

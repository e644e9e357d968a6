"""The parts of the link that only CubeStar has, with the whole program."""

from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.cubestar import INTERFACE

from .harness import Harness

EXPOSURE = INTERFACE.telecommand("Exposure")
GOOD = bytes([EXPOSURE.id]) + EXPOSURE.pack(exposure=5)


def test_counters_count_what_was_accepted_and_answered(unit: Harness) -> None:
    unit.uart(encode_frame(GOOD) + encode_frame(b"\x63") + encode_frame(b"\xfe"))
    unit.i2c_write(GOOD)
    unit.telemetry("IDMargin")
    values = unit.telemetry("ExtendedIdentification")
    assert (values["TcmdCount"], values["TlmCount"]) == (2, 1)
    assert unit.telemetry("ExtendedIdentification")["TlmCount"] == 2


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

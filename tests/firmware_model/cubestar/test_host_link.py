"""Frames and messages, good and bad, as the satellite sends them."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.link import SEND_BUFFER_BYTES
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.cubestar import INTERFACE, AckError
from cubestack.firmware_model.node.link import longest_command
from cubestack.firmware_model.node.queue import QUEUE_DEPTH

from .bench import Bench

EXPOSURE = INTERFACE.telecommand("Exposure")
GOOD = bytes([EXPOSURE.id]) + EXPOSURE.pack(exposure=5)
EMPTY_COMMANDS = [message for message in INTERFACE.telecommands if not message.length]
STEADY_TELEMETRY = [  # not changed by asking
    message
    for message in INTERFACE.telemetries
    if message.supported and message.name != "ExtendedIdentification"
]
NOISE = st.lists(
    st.one_of(
        st.binary(min_size=1, max_size=3),
        st.sampled_from([b"\x1f", b"\x7f", b"\xff", b"\x1f\x7f", b"\x1f\xff", GOOD, bytes(200)]),
    ),
    max_size=12,
).map(b"".join)


def ack(error: AckError) -> list[bytes]:
    return [bytes([error])]


def exposure(bench: Bench) -> int:
    bench.run()
    return int(bench.telemetry("Exposure")["exposure"])


# --- UART: acknowledges ---------------------------------------------------------------------------


def test_a_good_telecommand_is_acknowledged_and_executed(bench: Bench) -> None:
    assert bench.uart(encode_frame(GOOD)) == ack(AckError.OK)
    assert exposure(bench) == 5
    assert bench.flags() == set()


@pytest.mark.parametrize("identifier", [0, 39, 99, 108, 127])
def test_an_unknown_telecommand(bench: Bench, identifier: int) -> None:
    assert bench.uart(encode_frame(bytes([identifier]))) == ack(AckError.INVALID_ID)
    assert bench.flags() == {"TcmdIDError"}


@pytest.mark.parametrize("message", INTERFACE.telecommands, ids=lambda message: message.name)
def test_one_parameter_byte_too_many_or_too_few(bench: Bench, message: Message) -> None:
    packed = bytes([message.id]) + message.pack(**message.reset_values())
    assert bench.uart(encode_frame(packed + b"\0")) == ack(AckError.WRONG_LENGTH)
    assert bench.flags() == {"UART_Tcmd_TooManyParm"}
    if message.length:
        assert bench.uart(encode_frame(packed[:-1])) == ack(AckError.WRONG_LENGTH)
        assert bench.flags() == {"UART_Tcmd_TooManyParm", "UART_Tcmd_TooFewParm"}
    assert bench.telemetry("TcmdProcessed")["Processed"]  # nothing was queued


def test_a_frame_longer_than_any_telecommand(bench: Bench) -> None:
    frame = encode_frame(GOOD + bytes(longest_command(INTERFACE) + 1000))
    assert bench.uart(frame) == ack(AckError.WRONG_LENGTH)
    assert bench.flags() == {"UART_Tcmd_TooManyParm"}


def test_a_bad_parameter(bench: Bench) -> None:
    assert bench.send("ImageBlockSet", BlockNumber=4096) == AckError.BAD_PARAMETER
    assert bench.flags() == {"ImageBlockSizeError"}
    bench.run()
    assert not bench.program.link.queue


def test_a_full_buffer(bench: Bench) -> None:
    for value in range(QUEUE_DEPTH):
        assert bench.send("Exposure", exposure=value) == AckError.OK
    assert bench.send("Exposure", exposure=99) == AckError.BUFFER_FULL
    assert bench.flags() == {"UART_TcmdBufOfError"}
    assert exposure(bench) == QUEUE_DEPTH - 1
    assert bench.send("Exposure", exposure=99) == AckError.OK
    assert exposure(bench) == 99


def test_a_bad_telecommand_is_told_apart_from_a_full_buffer(bench: Bench) -> None:
    for _ in range(QUEUE_DEPTH):
        bench.send("Exposure")
    assert bench.uart(encode_frame(b"\x63")) == ack(AckError.INVALID_ID)
    assert bench.send("ImageBlockSet", BlockNumber=4096) == AckError.BAD_PARAMETER


def test_counters_count_what_was_accepted_and_answered(bench: Bench) -> None:
    bench.uart(encode_frame(GOOD) + encode_frame(b"\x63") + encode_frame(b"\xfe"))
    bench.i2c_write(GOOD)
    bench.telemetry("IDMargin")
    values = bench.telemetry("ExtendedIdentification")
    assert (values["TcmdCount"], values["TlmCount"]) == (2, 1)
    assert bench.telemetry("ExtendedIdentification")["TlmCount"] == 2


# --- UART: bad frames -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("noise", "flag"),
    [
        (b"\x00", "UART_ProtocolError"),
        (b"\x1f\x00", "UART_ProtocolError"),
        (b"\x1f\x7f\x07\x1f\x00", "UART_ProtocolError"),  # unknown escape in a frame
        (b"\x1f\x7f\x1f\xff", "UART_ProtocolError"),  # empty frame
        (b"\x1f\x7f\x07\x05", "UART_MsgIncomplete"),  # ended by the next frame's start
        (b"\x1f\xff" * 3, "UART_ProtocolError"),
    ],
)
def test_the_good_frame_behind_a_bad_one_works(bench: Bench, noise: bytes, flag: str) -> None:
    assert bench.uart(noise + encode_frame(GOOD)) == ack(AckError.OK)
    assert flag in bench.flags()
    assert exposure(bench) == 5


def test_half_a_frame_and_silence(bench: Bench) -> None:
    half = encode_frame(GOOD)[:-1]  # ends in an escape, which would swallow the next start
    assert bench.uart(half) == []
    bench.program.link.uart_silence()
    assert bench.flags() == {"UART_MsgIncomplete", "UART_RXTimeout"}
    assert bench.uart(encode_frame(GOOD)) == ack(AckError.OK)


def test_silence_between_frames_is_no_error(bench: Bench) -> None:
    bench.uart(encode_frame(GOOD))
    bench.program.link.uart_silence()
    assert bench.flags() == set()


def test_every_byte_value_comes_through(bench: Bench) -> None:
    data = bytes([0x1F, 0x7F, 0xFF, 0x1F, 0x1F, *range(123)])
    bench.command("UploadBlock", BlockNumber=0, Data=data)
    bench.command("ImageBlockSet", BlockNumber=0, BlockSize=2)
    assert bench.telemetry("ImageBlock")["Block"] == data


@given(NOISE)
@settings(max_examples=300, deadline=None)
def test_after_a_silence_no_good_frame_is_lost(catalogue: StarCatalogue, noise: bytes) -> None:
    bench = Bench(catalogue)
    bench.uart(noise)
    bench.program.link.uart_silence()
    bench.run(until_us=bench.now_us + 10_000_000)  # a telecommand may have been in the noise
    bench.received()
    assert bench.send("StopLoop") == AckError.OK


def test_an_unknown_telemetry_id_gets_no_answer(bench: Bench) -> None:
    for identifier in (0xFE, 138, 178, 199):
        assert bench.uart(encode_frame(bytes([identifier]))) == []
    assert bench.flags() == {"TlmIDError"}


def test_parameters_behind_a_telemetry_id_are_ignored(bench: Bench) -> None:
    (answer,) = bench.uart(encode_frame(bytes([156, 1, 2, 3])))
    assert answer == b"\x0a"


def test_answers_that_the_send_buffer_has_no_room_for_are_dropped(bench: Bench) -> None:
    block = encode_frame(bytes([143]))
    bench.backlog = SEND_BUFFER_BYTES - 132  # an empty block in its frame
    assert bench.uart(block) == [bytes([0xA5]) * 128]
    bench.backlog += 1
    assert bench.uart(block) == []
    assert bench.uart(encode_frame(GOOD)) == ack(AckError.OK)  # a shorter one fits
    bench.backlog = 0
    assert bench.uart(block) == [bytes([0xA5]) * 128]


def test_idle_means_that_a_reset_would_cut_nothing_short(bench: Bench) -> None:
    link = bench.program.link
    assert link.idle
    link.uart_byte(0x1F)
    assert not link.idle
    link.uart_silence()
    assert link.idle
    link.i2c_start(False)
    assert not link.idle
    link.i2c_stop()
    assert link.idle
    bench.backlog = 1
    assert not link.idle
    bench.backlog = 0
    bench.send("Exposure")
    assert not link.idle
    bench.run()
    assert link.idle


# --- I2C ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("message", STEADY_TELEMETRY, ids=lambda message: message.name)
def test_telemetry_with_a_repeated_start_is_the_one_of_the_uart(
    bench: Bench, message: Message
) -> None:
    (frame,) = bench.uart(encode_frame(bytes([message.id])))
    assert bench.i2c_read(message.length, message.id) == frame


def test_i2c_telecommand_and_acknowledge(bench: Bench) -> None:
    assert bench.i2c_write(GOOD) == len(GOOD)
    assert bench.i2c_read(1, 131) == b"\0"
    bench.run()
    assert bench.i2c_read(1, 131) == b"\1"
    assert exposure(bench) == 5
    assert bench.flags() == set()


def test_reading_too_much_gives_ff(bench: Bench) -> None:
    assert bench.i2c_read(4, 156) == b"\x0a\xff\xff\xff"
    assert bench.flags() == set()


def test_reading_without_an_id(bench: Bench) -> None:
    assert bench.i2c_read(3) == b"\xff\xff\xff"
    assert bench.flags() == {"I2C_WaitForIDReadRequestError"}


def test_an_answer_can_be_fetched_in_another_transfer_but_only_once(bench: Bench) -> None:
    bench.i2c_write(b"\x9c")
    assert bench.i2c_read(1) == b"\x0a"
    assert bench.flags() == set()
    assert bench.i2c_read(1) == b"\xff"
    assert bench.flags() == {"I2C_WaitForIDReadRequestError"}


def test_two_reads_of_one_transfer_go_on(bench: Bench) -> None:
    link = bench.program.link
    link.i2c_start(False)
    link.i2c_write(128)
    link.i2c_start(True)
    first = bytes(link.i2c_read() for _ in range(3))
    link.i2c_start(True)
    rest = bytes(link.i2c_read() for _ in range(5))
    link.i2c_stop()
    assert (first + rest)[:2] == bytes([5, 3])
    assert bench.i2c_read(8, 128)[:4] == (first + rest)[:4]


def test_an_unknown_id_on_i2c(bench: Bench) -> None:
    assert bench.i2c_read(2, 0xFE) == b"\xff\xff"
    assert bench.flags() == {"TlmIDError"}
    bench.i2c_write(b"\x63")
    assert bench.flags() == {"TlmIDError", "TcmdIDError"}


def test_wrong_lengths_on_i2c(bench: Bench) -> None:
    bench.i2c_write(GOOD[:-1])
    assert bench.flags() == {"I2C_TCMD_TooFewParm"}
    bench.i2c_write(GOOD + b"\0")
    assert bench.flags() == {"I2C_TCMD_TooFewParm", "I2C_TCMD_TooManyparm"}


def test_a_write_beyond_the_longest_telecommand_is_not_acknowledged(bench: Bench) -> None:
    upload = INTERFACE.telecommand("UploadBlock")
    longest = bytes([upload.id]) + upload.pack(BlockNumber=0, Data=bytes(128))
    assert len(longest) == longest_command(INTERFACE)
    assert bench.i2c_write(longest + bytes(50)) == longest_command(INTERFACE) + 1
    assert bench.flags() == {"I2C_TCMD_TooManyparm"}
    assert bench.i2c_write(longest) == longest_command(INTERFACE)
    bench.run()
    assert bench.telemetry("UploadStatus")["BlocksReceived"] == 1


def test_a_full_buffer_on_i2c(bench: Bench) -> None:
    for _ in range(QUEUE_DEPTH + 1):
        bench.i2c_write(GOOD)
    assert bench.flags() == {"I2C_TcmdBufOFError"}


def test_a_telecommand_that_a_repeated_start_ends(bench: Bench) -> None:
    link = bench.program.link
    link.i2c_start(False)
    for byte in GOOD:
        link.i2c_write(byte)
    link.i2c_start(False)
    link.i2c_write(156)
    link.i2c_start(True)
    assert link.i2c_read() == 10
    link.i2c_stop()
    assert exposure(bench) == 5


def test_an_address_alone_does_nothing(bench: Bench) -> None:
    bench.i2c_write(b"")
    assert bench.flags() == set()
    assert bench.telemetry("TcmdProcessed")["Processed"]


@pytest.mark.parametrize("message", EMPTY_COMMANDS, ids=lambda message: message.name)
def test_both_buses_carry_the_same_telecommands(bench: Bench, message: Message) -> None:
    bench.i2c_write(bytes([message.id]))
    (queued,) = bench.program.link.queue
    assert queued.message is message

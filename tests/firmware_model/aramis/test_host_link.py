from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cubestack.firmware_model.aramis.link import AramisLink
from cubestack.firmware_model.aramis.state import State
from cubestack.firmware_model.interface.aramis import INTERFACE, AckError
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.node.link import longest_command
from cubestack.firmware_model.node.queue import QueuedCommand

from .program_bench import Bench


class Desk:
    """A link with canned telemetry."""

    def __init__(self) -> None:
        self.bench = Bench()
        self.state = State(self.bench.flash)
        self.told: list[str] = []
        self.link = AramisLink(self.bench, self.bench.meter, self.state, self.values, self.tell)

    def values(self, message: Message) -> dict[str, Any]:
        return dict(message.reset_values())

    def tell(self, command: QueuedCommand) -> None:
        self.told.append(command.message.name)

    def uart(self, data: bytes) -> bytes:
        self.bench.sent = b""
        for byte in data:
            self.link.uart_byte(byte)
        return self.bench.sent

    def send(self, name: str, **values: object) -> AckError:
        message = INTERFACE.telecommand(name)
        answer = self.uart(encode_frame(bytes([message.id]) + message.pack(**values)))
        return AckError(answer[2])

    def i2c_write(self, data: bytes) -> list[bool]:
        self.link.i2c_start(False)
        acknowledged = [self.link.i2c_write(byte) for byte in data]
        self.link.i2c_stop()
        return acknowledged

    def i2c_read(self, identifier: int, count: int) -> bytes:
        self.link.i2c_start(False)
        self.link.i2c_write(identifier)
        self.link.i2c_start(True)
        data = bytes(self.link.i2c_read() for _ in range(count))
        self.link.i2c_stop()
        return data


def test_telecommands_are_acknowledged_queued_and_wake_the_program() -> None:
    desk = Desk()
    desk.bench.us = 77
    assert desk.send("SetGain", Gain=2.0) is AckError.OK
    assert desk.bench.sent == bytes.fromhex("1f7f001fff")
    command = desk.link.queue[0]
    assert (command.message.name, command.values, command.came_us) == ("SetGain", {"Gain": 2.0}, 77)
    assert desk.told == ["SetGain"]
    assert desk.bench.woken == 1
    assert desk.state.telecommands == 1


@pytest.mark.parametrize("message", INTERFACE.telemetries, ids=lambda m: m.name)
def test_every_telemetry_frame_answers_on_both_buses(message: Message) -> None:
    desk = Desk()
    expected = message.pack(**message.reset_values())
    assert desk.uart(encode_frame(bytes([message.id]))) == encode_frame(expected)
    assert desk.i2c_read(message.id, message.length) == expected
    assert desk.i2c_read(message.id, message.length + 2)[-2:] == b"\xff\xff"
    assert not desk.state.flags


@pytest.mark.parametrize("message", INTERFACE.telecommands, ids=lambda m: m.name)
def test_every_telecommand_is_taken_from_both_buses_with_its_length_only(message: Message) -> None:
    desk = Desk()
    frame = bytes([message.id]) + message.pack(**message.reset_values())
    bad_vector = message.name == "GetAttitudeNearVector"
    wanted = AckError.BAD_PARAMETER if bad_vector else AckError.OK
    assert desk.uart(encode_frame(frame)) == encode_frame(bytes([wanted]))
    assert all(desk.i2c_write(frame))
    assert len(desk.link.queue) == (0 if bad_vector else 2)
    for wrong in (frame + b"\0", frame[:-1]):
        if len(wrong) > 0:
            answer = desk.uart(encode_frame(wrong))
            assert answer == encode_frame(bytes([AckError.WRONG_LENGTH]))
    assert "TcmdLengthError" in desk.state.flags


def test_wrong_parameters_raise_their_flags() -> None:
    desk = Desk()
    assert desk.send("SetExposure", Rows=0) is AckError.BAD_PARAMETER
    assert desk.state.flags == {"ParameterError"}
    wrong = AckError.BAD_PARAMETER
    assert desk.send("GetAttitudeNearPoint", RightAscension=0, Declination=2) is wrong
    assert "DirectionError" in desk.state.flags
    desk.state.flags.clear()
    assert desk.send("GetAttitudeNearVector", X=0.5, Y=0.5, Z=0.5) is wrong
    assert desk.state.flags == {"DirectionError"}
    assert desk.send("GetAttitudeNearVector", X=0.6, Y=0.0, Z=0.8) is AckError.OK
    assert desk.send("SetBodyRotation", Q0=1, Q1=1, Q2=0, Q3=0) is wrong
    assert "RotationError" in desk.state.flags
    assert desk.send("SetBodyRotation", Q0=0.6, Q1=0, Q2=0, Q3=0.8) is AckError.OK
    message = INTERFACE.telecommand("GetAttitudeNearVector")
    nan = bytes([message.id]) + bytes.fromhex("0000c07f") * 3
    assert desk.uart(encode_frame(nan)) == encode_frame(bytes([wrong]))


def test_the_buffer_holds_four() -> None:
    desk = Desk()
    assert [desk.send("StopLoop") for _ in range(5)] == [AckError.OK] * 4 + [AckError.BUFFER_FULL]
    assert desk.state.flags == {"TcmdBufferOverflow"}
    assert len(desk.told) == 4


def test_unknown_ids_and_broken_frames() -> None:
    desk = Desk()
    assert desk.uart(encode_frame(b"\x63")) == encode_frame(bytes([AckError.INVALID_ID]))
    assert desk.uart(encode_frame(b"\xfe")) == b""
    assert desk.state.flags == {"TcmdIdError", "TlmIdError"}
    desk.state.flags.clear()
    assert desk.uart(b"\x00" + encode_frame(b"")) == b""
    assert desk.state.flags == {"UartProtocolError"}
    desk.uart(b"\x1f\x7f\x01\x1f\x7f")
    assert "UartIncomplete" in desk.state.flags
    desk.link.uart_silence()
    assert "UartTimeout" in desk.state.flags
    assert desk.uart(encode_frame(b"\x80")) != b""


def test_i2c_reads_without_an_id_and_writes_that_are_too_long() -> None:
    desk = Desk()
    desk.link.i2c_start(True)
    assert desk.link.i2c_read() == 0xFF
    desk.link.i2c_stop()
    assert desk.state.flags == {"I2cReadWithoutId"}
    acknowledged = desk.i2c_write(bytes(longest_command(INTERFACE) + 2))
    assert acknowledged[-1] is False
    assert all(acknowledged[:-1])
    assert "TcmdIdError" in desk.state.flags


def test_an_answer_that_the_buffer_can_not_hold_is_dropped() -> None:
    desk = Desk()
    desk.bench.backlog = 10_000
    assert desk.uart(encode_frame(b"\x80")) == b""


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=300))
def test_no_bytes_break_the_link(data: bytes) -> None:
    desk = Desk()
    desk.uart(data)
    desk.link.uart_silence()
    desk.i2c_write(data)
    desk.link.queue.clear()
    assert desk.send("StopLoop") is AckError.OK

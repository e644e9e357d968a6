import pytest

from cubestack.firmware_model.aramis.link import AramisLink
from cubestack.firmware_model.aramis.state import State
from cubestack.firmware_model.interface.aramis import INTERFACE, AckError
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.mcu.requests import Routine, Sleep
from cubestack.firmware_model.node.commands import QueuedCommand

from .harness import Harness


class Served(Harness):
    """A link with canned telemetry."""

    def __init__(self) -> None:
        super().__init__()
        self.state = State(self.flash)
        self.told: list[str] = []  #: urgent telecommands, by their names
        self._link = AramisLink(self, self.meter, self.state, Message.reset_values, self.tell)

    @property
    def link(self) -> AramisLink:
        return self._link

    def tell(self, command: QueuedCommand) -> None:
        self.told.append(command.message.name)


@pytest.fixture
def desk() -> Served:
    return Served()


def sleep() -> Routine[bool]:
    """A wake-up that came before is not lost."""
    return (yield Sleep(None))


def test_telecommands_are_acknowledged_queued_and_wake_the_program(desk: Served) -> None:
    desk.now_us = 77
    gain = INTERFACE.telecommand("SetGain")
    frame = encode_frame(bytes([gain.id]) + gain.pack(Gain=2.0))
    assert desk.wire(frame) == bytes.fromhex("1f7f001fff")
    command = desk.link.queue[0]
    assert (command.message.name, command.values, command.received_us) == (
        "SetGain",
        {"Gain": 2.0},
        77,
    )
    assert desk.told == ["SetGain"]
    assert desk.perform(sleep())
    assert desk.state.telecommands == 1


def test_wrong_parameters_raise_their_flags(desk: Served) -> None:
    wrong = AckError.BAD_PARAMETER
    for name, values, flag in (
        ("SetExposure", {"Rows": 0}, "ParameterError"),
        ("GetAttitudeNearPoint", {"RightAscension": 0, "Declination": 2}, "DirectionError"),
        ("GetAttitudeNearVector", {"X": 0.5, "Y": 0.5, "Z": 0.5}, "DirectionError"),
        ("SetBodyRotation", {"Q0": 1, "Q1": 1, "Q2": 0, "Q3": 0}, "RotationError"),
    ):
        desk.state.flags.clear()
        assert (desk.send(name, **values), desk.state.flags) == (wrong, {flag})
    assert desk.send("GetAttitudeNearVector", X=0.6, Y=0.0, Z=0.8) == AckError.OK
    assert desk.send("SetBodyRotation", Q0=0.6, Q1=0, Q2=0, Q3=0.8) == AckError.OK
    message = INTERFACE.telecommand("GetAttitudeNearVector")
    nan = bytes([message.id]) + bytes.fromhex("0000c07f") * 3
    assert desk.frames(nan) == [bytes([wrong])]


def test_the_buffer_holds_four(desk: Served) -> None:
    assert [desk.send("StopLoop") for _ in range(5)] == [AckError.OK] * 4 + [AckError.BUFFER_FULL]
    assert desk.state.flags == {"TcmdBufferOverflow"}
    assert len(desk.told) == 4

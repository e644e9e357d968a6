import zlib
from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.catalogue.flash_store import flash_image
from cubestack.firmware_model.aramis.hardware import FrameEnd
from cubestack.firmware_model.aramis.link import AramisLink
from cubestack.firmware_model.aramis.program import AramisProgram
from cubestack.firmware_model.aramis.state import State
from cubestack.firmware_model.interface.aramis import INTERFACE, AckError
from cubestack.firmware_model.interface.aramis.switches import AramisSwitches
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.mcu.requests import Routine, Sleep
from cubestack.firmware_model.node.commands import QueuedCommand
from cubestack.host.studies.aramis.sky import database

from ..sessions import Step, as_recorded
from .harness import Harness
from .test_pipeline import sky

FRAME_US = 33_000
BLOCK = bytes(range(128))

STEPS: list[Step] = [
    ("GetAttitude", {}),
    ("Activate", {}),
    ("GetAttitude", {}),
    ("GetAttitudeNearVector", {"X": 0.0, "Y": 0.0, "Z": 2.0}),
    ("GetAttitudeNearPoint", {"RightAscension": 1.0, "Declination": 0.3}),
    ("SetDetection", {"Spikes": 2, "Subtract": 0}),
    ("GetAttitude", {}),
    ("SetIdentification", {"Verify": 0, "Noise": 0.3, "Pivots": 3}),
    ("GetAttitude", {}),
    ("SetExposure", {"Rows": 300}),
    ("SetGain", {"Gain": 3.0}),
    ("SetField", {"FieldOfView": 18.0}),
    ("SetBodyRotation", {"Q0": 0.6, "Q3": 0.8}),
    ("SetSystemTime", {"JulianDay": 2_460_000, "Millisecond": 5}),
    ("SaveConfig", {}),
    ("ImageBlockSet", {"BlockNumber": 7}),
    ("WriteCameraRegister", {"Address": 9, "Value": 5}),
    ("SelectCameraRegister", {"Address": 9}),
    ("GetAttitude", {}),
    ("ClearConfig", {}),
    ("LatchUpAction", {"Step": 0}),
    ("GetAttitude", {}),
    ("LatchUpAction", {"Step": 1}),
    ("ReloadCatalogue", {}),
    ("RefreshCatalogue", {}),
    ("BeginCatalogue", {"Length": len(BLOCK), "Checksum": zlib.crc32(BLOCK)}),
    ("CommitCatalogue", {}),
    ("CatalogueBlock", {"BlockNumber": 0, "Data": BLOCK}),
    ("GetAttitude", {}),
]
AT_LAST = ("CommitCatalogue", "Deactivate", "StartLoop", "ClearErrorFlags", "Reset")
LATER: list[Step] = [(name, {}) for name in AT_LAST]


@lru_cache(maxsize=1)
def flash() -> NDArray[np.uint8]:
    return flash_image(database().pack())


class Unit(Harness):
    """The whole program; each frame that it waits for shows a sky."""

    boot_us = 2_000

    def __init__(self, switches: AramisSwitches) -> None:
        super().__init__()
        self.switches = switches
        self.frame, image = sky(9)[1], flash()
        self.catalogue_flash[: len(image)] = image
        self.catalogue_flash[[3, 9_000]] ^= 1
        self._boot()
        self.run()

    def start(self) -> Routine[None]:
        self.program = AramisProgram(self, self.meter, self.switches)
        return self.program.main()

    @property
    def link(self) -> AramisLink:
        return self.program.link

    @property
    def waiting(self) -> bool:
        return not self.program.commands.running and not self.link.queue

    def _slept(self, request: object, until_us: int | None) -> bool:
        if self.captures:
            self.captures.pop()[:] = self.frame
            self.now_us += FRAME_US
            self.program.frame_ended(FrameEnd.STORED)
        return super()._slept(request, until_us)

    def stop_capture(self) -> None:
        self.captures.clear()


@pytest.mark.parametrize("profile", ["published", "extended"])
def test_aramis_session_matches_its_recording(profile: str) -> None:
    unit = Unit(AramisSwitches.of(profile))
    as_recorded(unit, f"AraMiS session, {profile}", STEPS)
    as_recorded(unit, f"AraMiS session, {profile}, later", LATER)


@pytest.mark.parametrize("profile", ["published", "extended"])
def test_aramis_loop_matches_its_recording(profile: str) -> None:
    unit = Unit(AramisSwitches.of(profile))
    unit.command("SetReloadPeriod", Period=2)
    unit.command("Activate")
    unit.command("StartLoop", Period=700, Mode=1)
    unit.run(until_us=5_000_000)
    as_recorded(unit, f"AraMiS loop, {profile}", [])


NEED_IT = "GetAttitude", "GetAttitudeNearPoint", "StartLoop", "ReloadCatalogue", "RefreshCatalogue"


@pytest.mark.parametrize("name", NEED_IT)
def test_telecommands_that_need_activation_raise_not_active(name: str) -> None:
    unit = Unit(AramisSwitches.of("extended"))
    before = unit.telemetry("CatalogueStatus"), unit.telemetry("LoopStatus")
    unit.command(name)
    assert [flag for flag, up in unit.telemetry("ErrorFlags").items() if up] == ["NotActive"]
    assert (unit.telemetry("CatalogueStatus"), unit.telemetry("LoopStatus")) == before
    unit.command("Activate", "ClearErrorFlags", name)
    assert not unit.telemetry("ErrorFlags")["NotActive"]


@pytest.mark.parametrize("name", ["WriteCameraRegister", "SelectCameraRegister"])
def test_register_access_of_a_silent_camera_raises_camera_silent(name: str) -> None:
    unit = Harness()
    program = AramisProgram(unit, unit.meter)
    command = QueuedCommand(INTERFACE.telecommand(name), {"Address": 9, "Value": 5})
    unit.perform(program.commands.execute(command))
    assert not program.state.flags
    unit.registers = None
    unit.perform(program.commands.execute(command))
    assert program.state.flags == {"CameraSilent"}


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
    assert command.message.name == "SetGain"
    assert (command.values, command.received_us) == ({"Gain": 2.0}, 77)
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
    assert desk.told == ["GetAttitudeNearVector", "SetBodyRotation"]

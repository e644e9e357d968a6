"""Every error flag of telemetry ErrorFlags, raised by its cause and by nothing else."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.codec.switches import DEFAULT_PROFILE
from cubestack.firmware_model.interface.cubestar import INTERFACE, AckError, IdMode
from cubestack.firmware_model.interface.cubestar.flags import NEVER_RAISED
from cubestack.firmware_model.node.commands import QUEUE_DEPTH

from .harness import Harness
from .sky import Sky, draw, take

FLAGS = [field.name for field in INTERFACE.telemetry("ErrorFlags").fields]
SETTERS = [
    (message, field)
    for message in INTERFACE.telecommands
    for field in message.fields
    if field.range_flag
]
"""Parameters that raise a flag when they are out of range."""

OF_CHECKS = {"IDModeError", "LessThanThreeStarsID", "IDError"}
"""Flags of commanded modes and of what the printed Algorithm 2 does not look at."""

Act = Callable[[Harness, Sky], object]
CAUSES: dict[str, tuple[Act, tuple[str, ...]]] = {}

MODE_SELECT = b"\x81\x00"
DISABLE = MODE_SELECT + b"\x20"
DARK = np.zeros((512, 1024), np.uint8)


def flag(name: str, *others: str) -> Callable[[Act], Act]:
    """The function brings flag ``name`` about, and ``others`` with it."""

    def register(cause: Act) -> Act:
        assert CAUSES.setdefault(name, (cause, others)) == (cause, others)
        return cause

    return register


@pytest.mark.parametrize(
    ("name", "profile"),
    [
        (name, "extended" if name in OF_CHECKS else DEFAULT_PROFILE)
        for name in FLAGS
        if name not in NEVER_RAISED
    ],
)
def test_every_flag_is_raised_by_its_cause(name: str, unit: Harness, sky: Sky) -> None:
    if name not in CAUSES:
        assert name in {field.range_flag for _, field in SETTERS}, f"no cause of {name} is known"
        return  # the next test raises it

    def repeated() -> None:
        flags = unit.flags()
        log, performance = unit.telemetry("LogStatus"), unit.telemetry("PerformanceParameters")
        shown = {f.name: f.flag in flags for f in INTERFACE.telemetry("LogStatus").fields if f.flag}
        assert log == log | shown
        assert performance == performance | {
            "MaxStarsDetected": "MaxStarsDetection" in flags,
            "LessThanThreeStarsInFoV": "LessThanThreeStarsInFoV" in flags,
            "CommsError": any(flag.startswith(("UART_", "I2C_")) for flag in flags),
        }

    cause, others = CAUSES[name]
    cause(unit, sky)
    assert unit.flags() == {name, *others}
    repeated()
    unit.command("ClearErrorFlags")
    assert unit.flags() == set()
    repeated()


@pytest.mark.parametrize(
    ("message", "field"),
    SETTERS,
    ids=[f"{message.name}-{field.name}" for message, field in SETTERS],
)
def test_parameter_out_of_range_is_refused_and_sets_its_flag(
    unit: Harness, message: Message, field: Field
) -> None:
    bad = next(
        value
        for value in (0, 4, 255, 65535, -1e9)
        if field.type == "f32" or value <= field.raw_range[1]
        if not field.allows(value, message.reset_values() | {field.name: value})
    )
    assert unit.send(message.name, **{field.name: bad}) == AckError.BAD_PARAMETER
    assert unit.flags() == {field.range_flag}
    assert not unit.program.link.queue


def test_flags_without_a_cause_are_declared_as_never_raised() -> None:
    assert NEVER_RAISED.keys() == {
        "SPICommsError",  # no SPI bus
        "FlashInvalidAreaError",  # pages have fixed, aligned places, and are written whole
        "FlashUnalignedError",
        "FlashLockedError",  # never locked
        "FlashTimeoutError",  # the modelled flash does not fail
    }
    assert NEVER_RAISED.keys() <= set(FLAGS)
    assert not NEVER_RAISED.keys() & CAUSES.keys()


def overflow(send: Callable[[Harness], object]) -> Act:
    def fill(unit: Harness, _: Sky) -> None:
        for _ in range(QUEUE_DEPTH + 1):
            send(unit)
        unit.run()

    return fill


def silence(unit: Harness, _: Sky) -> None:
    unit.uart(b"\x1f\x7f\x07")
    unit.link.uart_silence()


def refusing(refuse: Callable[[bytes], bool], *before: str) -> Act:
    """The camera does not answer in a capture that comes after telecommands ``before``."""

    def capture(unit: Harness, _: Sky) -> None:
        for name in before:
            unit.command(name, **({"FrameRate": 9} if name == "SetFrameRate" else {}))
        unit.camera_refuses = refuse
        unit.command("CaptureImage")

    return capture


def over_current(unit: Harness, _: Sky) -> None:
    unit.program.supply.overcurrent("imager")
    unit.run()


def under_current(unit: Harness, _: Sky) -> None:
    unit.currents["imager"] = 0.0
    unit.telemetry("PowerStatus")
    unit.currents["imager"] = 50.0


def image_capture(unit: Harness, _: Sky) -> None:
    unit.frame_us = None
    unit.command("CaptureImage")


def detect(unit: Harness, picture: np.ndarray) -> None:
    unit.picture = picture
    unit.command("CaptureImage", "DetectStars")


def look_where_the_catalogue_has_no_stars(
    unit: Harness, sky: Sky, declination: float, mode: IdMode = IdMode.TRACKING
) -> None:
    """The catalogue keeps the stars north of 12 deg."""
    whole = unit.catalogue
    north = whole.vectors[:, 2] > 0.2
    unit.catalogue = StarCatalogue.build(
        whole.hip[north], whole.vectors[north].astype(float), whole.v_mag[north], 9.0, 50.0
    )
    unit.power_on()
    unit.command("setIDMode", IdMode=mode)
    unit.command("setTrackingMode", RightAscension=0.3, Declination=declination)
    unit.picture = sky.picture
    unit.command("CaptureAndProcess")


@pytest.mark.parametrize("profile", ["extended"])
def test_lost_in_space_failure_does_not_raise_a_catalogue_flag(unit: Harness) -> None:
    south = take(unit.catalogue, Rotation.from_euler("x", 180, degrees=True))
    look_where_the_catalogue_has_no_stars(unit, south, -1.2, IdMode.LOST_IN_SPACE)
    assert unit.flags() == {"IDError"}


NO_STARS = "LessThanThreeStarsDetected"
NOT_FOUND = ("IDSearchError", "LessThanThreeStarsID")
NOT_IN_FIELD = ("LessThanThreeStarsInFoV", *NOT_FOUND)
ACTS: dict[tuple[str, ...], Act] = {
    ("OverCurrent",): over_current,
    ("UnderCurrent",): under_current,
    ("UART_ProtocolError",): lambda unit, _: unit.uart(b"\x55"),
    ("UART_TcmdBufOfError",): overflow(lambda unit: unit.send("Exposure")),
    ("UART_Tcmd_TooManyParm",): lambda unit, _: unit.frames(b"\x10\x00"),
    ("UART_Tcmd_TooFewParm",): lambda unit, _: unit.frames(b"\x07\x00"),
    ("UART_MsgIncomplete",): lambda unit, _: unit.uart(b"\x1f\x7f\x07" + encode_frame(b"\x83")),
    ("UART_RXTimeout", "UART_MsgIncomplete"): silence,
    ("I2C_WaitForIDReadRequestError",): lambda unit, _: unit.i2c_read(1),
    ("I2C_TcmdBufOFError",): overflow(lambda unit: unit.i2c_write(b"\x07\x00\x00")),
    ("I2C_TCMD_TooFewParm",): lambda unit, _: unit.i2c_write(b"\x07\x00"),
    ("I2C_TCMD_TooManyparm",): lambda unit, _: unit.i2c_write(b"\x07\x00\x00\x00"),
    ("TcmdIDError",): lambda unit, _: unit.frames(b"\x63"),
    ("TlmIDError",): lambda unit, _: unit.frames(b"\xc0"),
    ("StatusError",): lambda unit, _: unit.command("DetectStars"),
    ("ISSetupError",): refusing(lambda _data: True),
    ("ConfigChangeError",): refusing(lambda _data: True, "CaptureImage", "SetFrameRate"),
    ("ISEnableError",): refusing(lambda data: data[:2] == MODE_SELECT, "CaptureImage"),
    ("ISDisableError",): refusing(lambda data: data == DISABLE, "CaptureImage"),
    ("ImageCaptureError",): image_capture,
    ("MaxInvalidStarsDetectionError", NO_STARS): lambda unit, _: detect(unit, DARK + np.uint8(80)),
    (NO_STARS,): lambda unit, _: detect(unit, DARK),
    NOT_IN_FIELD: lambda *given: look_where_the_catalogue_has_no_stars(*given, declination=-0.35),
    ("ReducedIDListSizeError", *NOT_IN_FIELD): lambda *given: look_where_the_catalogue_has_no_stars(
        *given, declination=-1.2
    ),
}
for raised, act in ACTS.items():
    flag(*raised)(act)


@flag("TimingError")
def timing(unit: Harness, sky: Sky) -> None:
    unit.picture = sky.picture
    unit.command("SetDiscardDelay", Delay=1000)  # and 386 ms, and 404 ms
    unit.start_loop(2.5)
    unit.command("StopLoop")


@flag("TriggerAlreadySet")
def triggered(unit: Harness, sky: Sky) -> None:
    unit.picture = sky.picture
    unit.start_loop(0.1)
    unit.start_loop(0.85)
    unit.command("StopLoop")


@flag("TimerAlreadyRunning")
def timer_running(unit: Harness, _: Sky) -> None:
    unit.command("setDelayTimerTimeout", Time=100)
    unit.send("Trigger")
    unit.send("Trigger")
    unit.command("StopLoop")


@flag("MaxStarsDetection")
def max_stars(unit: Harness, sky: Sky) -> None:
    unit.command("setDetectionVariables", MaxStars=5)
    detect(unit, sky.picture)


@flag("MaxNoiseDetected", "LessThanThreeStarsDetected")
def max_noise(unit: Harness, _: Sky) -> None:
    picture = DARK.copy()
    picture[::3, ::3] = 60
    detect(unit, picture)


@flag("IDModeError")
def id_mode(unit: Harness, sky: Sky) -> None:
    unit.command("setIDMode", IdMode=IdMode.TRACKING)
    detect(unit, sky.picture)
    unit.command("IDStars")


@flag("LessThanThreeStarsID")
def few_identified(unit: Harness, sky: Sky) -> None:
    first, second, third = unit.catalogue.vectors[sky.stars[:3]].astype(float)
    astray = Rotation.from_rotvec(0.05 * first).apply(third)  # as far from the first one as ever
    detect(unit, draw(np.array([first, second, astray]), sky.attitude).picture)
    unit.command("IDStars")


@flag("IDError")
def id_error(unit: Harness, sky: Sky) -> None:
    detect(unit, sky.picture[:, ::-1])  # the sky in a mirror
    unit.command("setPrincipalPoint", Cx=1023 - 539.0, Cy=175.5)
    unit.command("setTangentalDistortionGains", P1=-0.00414, P2=-0.00624)
    unit.command("DetectStars", "IDStars")


@flag("IDSearchError", "LessThanThreeStarsID")
def id_search(unit: Harness, sky: Sky) -> None:
    unit.command("setIDMargin", Margin=0.0001)
    picture = DARK.copy()
    for x, y in ((60, 60), (71, 60), (60, 72)):  # closer than any three in the catalogue
        picture[y : y + 4, x : x + 4] = 80
    detect(unit, picture)
    unit.command("IDStars")


@flag("RateExceeded", "IDSearchError", "LessThanThreeStarsID")
def rate_exceeded(unit: Harness, sky: Sky) -> None:
    unit.picture = sky.picture
    unit.command("CaptureAndProcess")
    unit.command("setIDMode", IdMode=IdMode.TRACKING)
    turned = Rotation.from_euler("x", 2.0, degrees=True) * sky.attitude
    unit.picture = take(unit.catalogue, turned).picture
    unit.command("CaptureAndProcess")


@flag("QuestindexError")
def quest_index(unit: Harness, sky: Sky) -> None:
    detect(unit, sky.picture)
    unit.command("EstimateAttitude")

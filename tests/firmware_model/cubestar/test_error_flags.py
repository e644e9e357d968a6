"""Every error flag of telemetry ErrorFlags, raised by its cause and by nothing else."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.codec.message import Field, Message
from cubestack.firmware_model.interface.cubestar import INTERFACE, AckError, IdMode
from cubestack.firmware_model.interface.cubestar.flags import NEVER_RAISED
from cubestack.firmware_model.node.queue import QUEUE_DEPTH

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

Cause = Callable[[Harness, Sky], None]
CAUSES: dict[str, Cause] = {}

MODE_SELECT = b"\x81\x00"
DISABLE = MODE_SELECT + b"\x20"


def flag(name: str, *others: str) -> Callable[[Cause], Cause]:
    """The function brings flag ``name`` about, and ``others`` with it."""

    def register(cause: Cause) -> Cause:
        def check(unit: Harness, sky: Sky) -> None:
            cause(unit, sky)
            assert unit.flags() == {name, *others}

        assert CAUSES.setdefault(name, check) is check
        return cause

    return register


@pytest.mark.parametrize("name", [name for name in FLAGS if name not in NEVER_RAISED])
def test_every_flag_is_raised_by_its_cause(name: str, unit: Harness, sky: Sky) -> None:
    if name not in CAUSES:
        assert name in {field.range_flag for _, field in SETTERS}, f"no cause of {name} is known"
        return  # the next test raises it
    CAUSES[name](unit, sky)
    assert unit.telemetry("LogStatus") == unit.telemetry("LogStatus") | {
        field.name: field.flag in unit.flags()
        for field in INTERFACE.telemetry("LogStatus").fields
        if field.flag
    }
    unit.command("ClearErrorFlags")
    assert unit.flags() == set()


@pytest.mark.parametrize(
    ("message", "field"),
    SETTERS,
    ids=[f"{message.name}-{field.name}" for message, field in SETTERS],
)
def test_a_parameter_out_of_range(unit: Harness, message: Message, field: Field) -> None:
    bad = next(
        value
        for value in (0, 4, 255, 65535, -1e9)
        if field.type == "f32" or value <= field.raw_range[1]
        if not field.allows(value, message.reset_values() | {field.name: value})
    )
    assert unit.send(message.name, **{field.name: bad}) == AckError.BAD_PARAMETER
    assert unit.flags() == {field.range_flag}
    assert not unit.program.link.queue


def test_flags_that_this_hardware_can_not_raise() -> None:
    assert NEVER_RAISED.keys() == {
        "SPICommsError",  # no SPI bus
        "FlashInvalidAreaError",  # pages have fixed, aligned places, and are written whole
        "FlashUnalignedError",
        "FlashLockedError",  # never locked
        "FlashTimeoutError",  # the modelled flash does not fail
    }
    assert NEVER_RAISED.keys() <= set(FLAGS)
    assert not NEVER_RAISED.keys() & CAUSES.keys()


# --- supply ---------------------------------------------------------------------------------------


@flag("OverCurrent")
def over_current(unit: Harness, _: Sky) -> None:
    unit.program.supply.overcurrent("imager")
    unit.run()


@flag("UnderCurrent")
def under_current(unit: Harness, _: Sky) -> None:
    unit.currents["imager"] = 0.0
    unit.telemetry("PowerStatus")
    unit.currents["imager"] = 50.0


# --- buses ----------------------------------------------------------------------------------------


def overflow(send: Callable[[Harness], object]) -> Callable[[Harness], None]:
    """One telecommand more than the queue holds."""

    def fill(unit: Harness) -> None:
        for _ in range(QUEUE_DEPTH + 1):
            send(unit)
        unit.run()

    return fill


def silence(unit: Harness) -> None:
    unit.uart(b"\x1f\x7f\x07")
    unit.link.uart_silence()


BUS_CAUSES: dict[tuple[str, ...], Callable[[Harness], object]] = {
    ("UART_ProtocolError",): lambda unit: unit.uart(b"\x55"),
    ("UART_TcmdBufOfError",): overflow(lambda unit: unit.send("Exposure")),
    ("UART_Tcmd_TooManyParm",): lambda unit: unit.frames(b"\x10\x00"),
    ("UART_Tcmd_TooFewParm",): lambda unit: unit.frames(b"\x07\x00"),
    ("UART_MsgIncomplete",): lambda unit: unit.uart(b"\x1f\x7f\x07" + encode_frame(b"\x83")),
    ("UART_RXTimeout", "UART_MsgIncomplete"): silence,
    ("I2C_WaitForIDReadRequestError",): lambda unit: unit.i2c_read(1),
    ("I2C_TcmdBufOFError",): overflow(lambda unit: unit.i2c_write(b"\x07\x00\x00")),
    ("I2C_TCMD_TooFewParm",): lambda unit: unit.i2c_write(b"\x07\x00"),
    ("I2C_TCMD_TooManyparm",): lambda unit: unit.i2c_write(b"\x07\x00\x00\x00"),
    ("TcmdIDError",): lambda unit: unit.frames(b"\x63"),
    ("TlmIDError",): lambda unit: unit.frames(b"\xc0"),
}
for raised, act in BUS_CAUSES.items():
    flag(*raised)(lambda unit, _sky, act=act: act(unit))


# --- image sensor and picture ---------------------------------------------------------------------


@flag("StatusError")
def status_error(unit: Harness, _: Sky) -> None:
    unit.command("DetectStars")


@flag("ISSetupError")
def set_up(unit: Harness, _: Sky) -> None:
    unit.camera_refuses = lambda _data: True
    unit.command("CaptureImage")


@flag("ConfigChangeError")
def config_change(unit: Harness, _: Sky) -> None:
    unit.command("CaptureImage")
    unit.command("Exposure", exposure=9)
    unit.camera_refuses = lambda _data: True
    unit.command("CaptureImage")


@flag("ISEnableError")
def enable(unit: Harness, _: Sky) -> None:
    unit.command("CaptureImage")
    unit.camera_refuses = lambda data: data[:2] == MODE_SELECT
    unit.command("CaptureImage")


@flag("ISDisableError")
def disable(unit: Harness, _: Sky) -> None:
    unit.command("CaptureImage")
    unit.camera_refuses = lambda data: data == DISABLE
    unit.command("CaptureImage")


@flag("ImageCaptureError")
def image_capture(unit: Harness, _: Sky) -> None:
    unit.frame_us = None
    unit.command("CaptureImage")


# --- loop -----------------------------------------------------------------------------------------


@flag("TimingError")
def timing(unit: Harness, sky: Sky) -> None:
    unit.picture = sky.picture
    unit.command("SetDiscardDelay", Delay=1000)  # and 386 ms, and 404 ms
    unit.send("Trigger")
    unit.run(until_us=unit.now_us + 2_500_000)
    unit.send("StopLoop")
    unit.run()


@flag("TriggerAlreadySet")
def triggered(unit: Harness, sky: Sky) -> None:
    unit.picture = sky.picture
    unit.send("Trigger")
    unit.run(until_us=unit.now_us + 100_000)
    unit.send("Trigger")
    unit.run(until_us=unit.now_us + 850_000)
    unit.send("StopLoop")
    unit.run()


@flag("TimerAlreadyRunning")
def timer_running(unit: Harness, _: Sky) -> None:
    unit.command("setDelayTimerTimeout", Time=1.0)
    unit.send("Trigger")
    unit.send("Trigger")
    unit.send("StopLoop")
    unit.run()


# --- detection ------------------------------------------------------------------------------------


def detect(unit: Harness, picture: np.ndarray) -> None:
    unit.picture = picture
    unit.command("CaptureImage")
    unit.command("DetectStars")


@flag("MaxStarsDetection")
def max_stars(unit: Harness, sky: Sky) -> None:
    unit.command("setDetectionVariables", MaxStars=5)
    detect(unit, sky.picture)


@flag("MaxInvalidStarsDetectionError", "LessThanThreeStarsDetected")
def max_invalid(unit: Harness, _: Sky) -> None:
    detect(unit, np.full((512, 1024), 80, np.uint8))


@flag("MaxNoiseDetected", "LessThanThreeStarsDetected")
def max_noise(unit: Harness, _: Sky) -> None:
    picture = np.zeros((512, 1024), np.uint8)
    picture[::3, ::3] = 60
    detect(unit, picture)


@flag("LessThanThreeStarsDetected")
def few_detected(unit: Harness, _: Sky) -> None:
    detect(unit, np.zeros((512, 1024), np.uint8))


# --- identification -------------------------------------------------------------------------------


def spots(*places: tuple[int, int]) -> np.ndarray:
    picture = np.zeros((512, 1024), np.uint8)
    for x, y in places:
        picture[y : y + 4, x : x + 4] = 80
    return picture


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
    unit.command("DetectStars")
    unit.command("IDStars")


@flag("IDSearchError", "LessThanThreeStarsID")
def id_search(unit: Harness, sky: Sky) -> None:
    unit.command("setIDMargin", Margin=0.0001)
    detect(unit, spots((60, 60), (71, 60), (60, 72)))  # closer than any three in the catalogue
    unit.command("IDStars")


@flag("RateExceeded", "IDSearchError", "LessThanThreeStarsID")
def rate_exceeded(unit: Harness, sky: Sky) -> None:
    unit.picture = sky.picture
    unit.command("CaptureAndProcess")
    unit.command("setIDMode", IdMode=IdMode.TRACKING)
    turned = Rotation.from_euler("x", 2.0, degrees=True) * sky.attitude
    unit.picture = take(unit.catalogue, turned).picture
    unit.command("CaptureAndProcess")


def look_where_the_catalogue_has_no_stars(unit: Harness, sky: Sky, declination: float) -> None:
    """The catalogue keeps the stars north of 12 deg."""
    whole = unit.catalogue
    north = whole.vectors[:, 2] > 0.2
    unit.catalogue = StarCatalogue.build(
        whole.hip[north], whole.vectors[north].astype(float), whole.v_mag[north], 9.0, 50.0
    )
    unit.power_on()
    unit.command("setIDMode", IdMode=IdMode.TRACKING)
    unit.command("setTrackingMode", RightAscension=0.3, Declination=declination)
    unit.picture = sky.picture
    unit.command("CaptureAndProcess")


@flag("LessThanThreeStarsInFoV", "IDSearchError", "LessThanThreeStarsID")
def few_in_field(unit: Harness, sky: Sky) -> None:
    look_where_the_catalogue_has_no_stars(unit, sky, declination=-0.35)


@flag("ReducedIDListSizeError", "LessThanThreeStarsInFoV", "IDSearchError", "LessThanThreeStarsID")
def none_near(unit: Harness, sky: Sky) -> None:
    look_where_the_catalogue_has_no_stars(unit, sky, declination=-1.2)


@flag("QuestindexError")
def quest_index(unit: Harness, sky: Sky) -> None:
    detect(unit, sky.picture)
    unit.command("EstimateAttitude")

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

from .bench import Bench
from .sky import Sky, draw, take

FLAGS = [field.name for field in INTERFACE.telemetry("ErrorFlags").fields]
SETTERS = [
    (message, field)
    for message in INTERFACE.telecommands
    for field in message.fields
    if field.range_flag
]
"""Parameters that raise a flag when they are out of range."""

Cause = Callable[[Bench, Sky], None]
CAUSES: dict[str, Cause] = {}

MODE_SELECT = b"\x81\x00"
DISABLE = MODE_SELECT + b"\x20"


def flag(name: str, *others: str) -> Callable[[Cause], Cause]:
    """The function brings flag ``name`` about, and ``others`` with it."""

    def register(cause: Cause) -> Cause:
        def check(bench: Bench, sky: Sky) -> None:
            cause(bench, sky)
            assert bench.flags() == {name, *others}

        assert CAUSES.setdefault(name, check) is check
        return cause

    return register


@pytest.mark.parametrize("name", [name for name in FLAGS if name not in NEVER_RAISED])
def test_every_flag_is_raised_by_its_cause(name: str, bench: Bench, sky: Sky) -> None:
    if name not in CAUSES:
        assert name in {field.range_flag for _, field in SETTERS}, f"no cause of {name} is known"
        return  # the next test raises it
    CAUSES[name](bench, sky)
    assert bench.telemetry("LogStatus") == bench.telemetry("LogStatus") | {
        field.name: field.flag in bench.flags()
        for field in INTERFACE.telemetry("LogStatus").fields
        if field.flag
    }
    bench.command("ClearErrorFlags")
    assert bench.flags() == set()


@pytest.mark.parametrize(
    ("message", "field"),
    SETTERS,
    ids=[f"{message.name}-{field.name}" for message, field in SETTERS],
)
def test_a_parameter_out_of_range(bench: Bench, message: Message, field: Field) -> None:
    bad = next(
        value
        for value in (0, 4, 255, 65535, -1e9)
        if field.type == "f32" or value <= field.raw_range[1]
        if not field.allows(value, message.reset_values() | {field.name: value})
    )
    assert bench.send(message.name, **{field.name: bad}) == AckError.BAD_PARAMETER
    assert bench.flags() == {field.range_flag}
    assert not bench.program.link.queue


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
def over_current(bench: Bench, _: Sky) -> None:
    bench.program.supply.overcurrent("imager")
    bench.run()


@flag("UnderCurrent")
def under_current(bench: Bench, _: Sky) -> None:
    bench.currents["imager"] = 0.0
    bench.telemetry("PowerStatus")
    bench.currents["imager"] = 50.0


# --- buses ----------------------------------------------------------------------------------------


@flag("UART_ProtocolError")
def uart_protocol(bench: Bench, _: Sky) -> None:
    bench.uart(b"\x55")


@flag("UART_TcmdBufOfError")
def uart_overflow(bench: Bench, _: Sky) -> None:
    for _ in range(QUEUE_DEPTH + 1):
        bench.send("Exposure")
    bench.run()


@flag("UART_Tcmd_TooManyParm")
def uart_too_many(bench: Bench, _: Sky) -> None:
    bench.uart(encode_frame(b"\x10\x00"))


@flag("UART_Tcmd_TooFewParm")
def uart_too_few(bench: Bench, _: Sky) -> None:
    bench.uart(encode_frame(b"\x07\x00"))


@flag("UART_MsgIncomplete")
def uart_incomplete(bench: Bench, _: Sky) -> None:
    bench.uart(b"\x1f\x7f\x07" + encode_frame(b"\x83"))


@flag("UART_RXTimeout", "UART_MsgIncomplete")
def uart_timeout(bench: Bench, _: Sky) -> None:
    bench.uart(b"\x1f\x7f\x07")
    bench.program.link.uart_silence()


@flag("I2C_WaitForIDReadRequestError")
def i2c_no_id(bench: Bench, _: Sky) -> None:
    bench.i2c_read(1)


@flag("I2C_TcmdBufOFError")
def i2c_overflow(bench: Bench, _: Sky) -> None:
    for _ in range(QUEUE_DEPTH + 1):
        bench.i2c_write(b"\x07\x00\x00")
    bench.run()


@flag("I2C_TCMD_TooFewParm")
def i2c_too_few(bench: Bench, _: Sky) -> None:
    bench.i2c_write(b"\x07\x00")


@flag("I2C_TCMD_TooManyparm")
def i2c_too_many(bench: Bench, _: Sky) -> None:
    bench.i2c_write(b"\x07\x00\x00\x00")


@flag("TcmdIDError")
def unknown_telecommand(bench: Bench, _: Sky) -> None:
    bench.uart(encode_frame(b"\x63"))


@flag("TlmIDError")
def unknown_telemetry(bench: Bench, _: Sky) -> None:
    bench.uart(encode_frame(b"\xc0"))


# --- image sensor and picture ---------------------------------------------------------------------


@flag("StatusError")
def status_error(bench: Bench, _: Sky) -> None:
    bench.command("DetectStars")


@flag("ISSetupError")
def set_up(bench: Bench, _: Sky) -> None:
    bench.camera_refuses = lambda _data: True
    bench.command("CaptureImage")


@flag("ConfigChangeError")
def config_change(bench: Bench, _: Sky) -> None:
    bench.command("CaptureImage")
    bench.command("Exposure", exposure=9)
    bench.camera_refuses = lambda _data: True
    bench.command("CaptureImage")


@flag("ISEnableError")
def enable(bench: Bench, _: Sky) -> None:
    bench.command("CaptureImage")
    bench.camera_refuses = lambda data: data[:2] == MODE_SELECT
    bench.command("CaptureImage")


@flag("ISDisableError")
def disable(bench: Bench, _: Sky) -> None:
    bench.command("CaptureImage")
    bench.camera_refuses = lambda data: data == DISABLE
    bench.command("CaptureImage")


@flag("ImageCaptureError")
def image_capture(bench: Bench, _: Sky) -> None:
    bench.frame_us = None
    bench.command("CaptureImage")


# --- loop -----------------------------------------------------------------------------------------


@flag("TimingError")
def timing(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.command("SetDiscardDelay", Delay=1000)  # and 386 ms, and 404 ms
    bench.send("Trigger")
    bench.run(until_us=bench.now_us + 2_500_000)
    bench.send("StopLoop")
    bench.run()


@flag("TriggerAlreadySet")
def triggered(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.send("Trigger")
    bench.run(until_us=bench.now_us + 100_000)
    bench.send("Trigger")
    bench.run(until_us=bench.now_us + 850_000)
    bench.send("StopLoop")
    bench.run()


@flag("TimerAlreadyRunning")
def timer_running(bench: Bench, _: Sky) -> None:
    bench.command("setDelayTimerTimeout", Time=1.0)
    bench.send("Trigger")
    bench.send("Trigger")
    bench.send("StopLoop")
    bench.run()


# --- detection ------------------------------------------------------------------------------------


def detect(bench: Bench, picture: np.ndarray) -> None:
    bench.picture = picture
    bench.command("CaptureImage")
    bench.command("DetectStars")


@flag("MaxStarsDetection")
def max_stars(bench: Bench, sky: Sky) -> None:
    bench.command("setDetectionVariables", MaxStars=5)
    detect(bench, sky.picture)


@flag("MaxInvalidStarsDetectionError", "LessThanThreeStarsDetected")
def max_invalid(bench: Bench, _: Sky) -> None:
    detect(bench, np.full((512, 1024), 80, np.uint8))


@flag("MaxNoiseDetected", "LessThanThreeStarsDetected")
def max_noise(bench: Bench, _: Sky) -> None:
    picture = np.zeros((512, 1024), np.uint8)
    picture[::3, ::3] = 60
    detect(bench, picture)


@flag("LessThanThreeStarsDetected")
def few_detected(bench: Bench, _: Sky) -> None:
    detect(bench, np.zeros((512, 1024), np.uint8))


# --- identification -------------------------------------------------------------------------------


def spots(*places: tuple[int, int]) -> np.ndarray:
    picture = np.zeros((512, 1024), np.uint8)
    for x, y in places:
        picture[y : y + 4, x : x + 4] = 80
    return picture


@flag("IDModeError")
def id_mode(bench: Bench, sky: Sky) -> None:
    bench.command("setIDMode", IdMode=IdMode.TRACKING)
    detect(bench, sky.picture)
    bench.command("IDStars")


@flag("LessThanThreeStarsID")
def few_identified(bench: Bench, sky: Sky) -> None:
    first, second, third = bench.catalogue.vectors[sky.stars[:3]].astype(float)
    astray = Rotation.from_rotvec(0.05 * first).apply(third)  # as far from the first one as ever
    detect(bench, draw(np.array([first, second, astray]), sky.attitude).picture)
    bench.command("IDStars")


@flag("IDError")
def id_error(bench: Bench, sky: Sky) -> None:
    detect(bench, sky.picture[:, ::-1])  # the sky in a mirror
    bench.command("setPrincipalPoint", Cx=1023 - 539.0, Cy=175.5)
    bench.command("setTangentalDistortionGains", P1=-0.00414, P2=-0.00624)
    bench.command("DetectStars")
    bench.command("IDStars")


@flag("IDSearchError", "LessThanThreeStarsID")
def id_search(bench: Bench, sky: Sky) -> None:
    bench.command("setIDMargin", Margin=0.0001)
    detect(bench, spots((60, 60), (71, 60), (60, 72)))  # closer than any three in the catalogue
    bench.command("IDStars")


@flag("RateExceeded", "IDSearchError", "LessThanThreeStarsID")
def rate_exceeded(bench: Bench, sky: Sky) -> None:
    bench.picture = sky.picture
    bench.command("CaptureAndProcess")
    bench.command("setIDMode", IdMode=IdMode.TRACKING)
    turned = Rotation.from_euler("x", 2.0, degrees=True) * sky.attitude
    bench.picture = take(bench.catalogue, turned).picture
    bench.command("CaptureAndProcess")


def look_where_the_catalogue_has_no_stars(bench: Bench, sky: Sky, declination: float) -> None:
    """The catalogue keeps the stars north of 12 deg."""
    whole = bench.catalogue
    north = whole.vectors[:, 2] > 0.2
    bench.catalogue = StarCatalogue.build(
        whole.hip[north], whole.vectors[north].astype(float), whole.v_mag[north], 9.0, 50.0
    )
    bench.power_on()
    bench.command("setIDMode", IdMode=IdMode.TRACKING)
    bench.command("setTrackingMode", RightAscension=0.3, Declination=declination)
    bench.picture = sky.picture
    bench.command("CaptureAndProcess")


@flag("LessThanThreeStarsInFoV", "IDSearchError", "LessThanThreeStarsID")
def few_in_field(bench: Bench, sky: Sky) -> None:
    look_where_the_catalogue_has_no_stars(bench, sky, declination=-0.35)


@flag("ReducedIDListSizeError", "LessThanThreeStarsInFoV", "IDSearchError", "LessThanThreeStarsID")
def none_near(bench: Bench, sky: Sky) -> None:
    look_where_the_catalogue_has_no_stars(bench, sky, declination=-1.2)


@flag("QuestindexError")
def quest_index(bench: Bench, sky: Sky) -> None:
    detect(bench, sky.picture)
    bench.command("EstimateAttitude")

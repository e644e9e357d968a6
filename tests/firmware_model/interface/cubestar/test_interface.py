"""The oracle is printed_layouts.txt: the layouts as the CubeSpace family's tables print
them. One message an entry: ID, name, length in bytes, then every field as name@bit offset:type,
with what the value is divided by.
"""

import math
import re
from pathlib import Path

import pytest

from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.cubestar import INTERFACE, ImageBlockSize
from tests.together import together

PRINTED = Path(__file__).with_name("printed_layouts.txt").read_text(encoding="ascii")

STEPPING = {
    *("StarPositions", "BodyUnitVectors", "IDStarsDetails"),
    *("InertialUnitVectors", "StarDetails", "HipparcosNumber"),
}
BY_ID = {message.id: message for message in INTERFACE.messages}


@together("entry", re.split(r"\n(?=\d)", PRINTED.strip()))
def test_cubestar_messages_have_the_printed_layout(entry: str) -> None:
    number, name, length, *fields = entry.split()
    message = BY_ID[int(number)]
    assert (message.name, message.length, message.extension) == (name, int(length), False)
    assert len(message.fields) == len(fields)
    for field, printed in zip(message.fields, fields, strict=True):
        layout, _, scale = printed.partition("/")
        assert f"{field.name}@{field.bit_offset}:{field.type}" == layout
        assert field.scale == float(scale or 1)


def test_printed_cubestar_messages_are_declared_and_extensions_in_range() -> None:
    printed = {int(entry.split()[0]) for entry in re.split(r"\n(?=\d)", PRINTED.strip())}
    ours = {message.id for message in INTERFACE.messages if message.extension}
    assert printed == set(range(1, 39)) | set(range(128, 178))
    assert ours == BY_ID.keys() - printed
    assert ours <= set(range(100, 128)) | set(range(200, 256))


def test_times_are_in_ms_and_currents_in_milliamperes() -> None:
    published = [message for message in INTERFACE.telemetries if not message.extension]
    timing = [message for message in published if re.search(r"Tim(e|ing)", message.name)]
    assert len(timing) == 11
    for message in timing:
        assert {field.unit for field in message.fields} <= {"ms", "s", "x 10 ms"}
    status = INTERFACE.telemetry("PowerStatus").unpack(bytes.fromhex("01 4700 0000 0000"))
    assert status["Current"] == 71


def test_settings_have_the_published_reset_values() -> None:
    def resets(name: str) -> dict[str, Value]:
        return INTERFACE.telecommand(name).reset_values()

    assert resets("setDetectionThresholds")["DetectionThreshold"] == 6
    assert resets("setStarPixels") == {"MinPixels": 6, "MaxPixels": 60}
    assert resets("setDetectionVariables")["MaxStars"] == 20
    assert resets("setDetectionVariables")["MaxInvalidStars"] == 50
    assert resets("setDetectionVariables")["GridSize"] == 5
    assert resets("setDetectionRegion")["StepSize"] == 3
    assert resets("setIDMargin")["Margin"] == pytest.approx(0.001)
    assert resets("setFocalLength")["FocalLength"] == pytest.approx(6.28)
    assert resets("setFocalLengthComponents")["Fy"] == pytest.approx(1147.4)
    assert resets("setPrincipalPoint") == {"Cx": 539.0, "Cy": 175.5}
    assert resets("setRadialDistortionGains")["K2"] == pytest.approx(-0.12456)
    assert resets("setTangentalDistortionGains")["P2"] == pytest.approx(0.00624)
    assert resets("SetFrameRate")["FrameRate"] == 7
    assert resets("SetDiscardDelay")["Delay"] == 70


def test_log_status_contains_every_error_flag() -> None:
    flags = INTERFACE.telemetry("ErrorFlags")
    shown = {field.flag for field in INTERFACE.telemetry("LogStatus").fields} - {""}
    assert shown == {field.name for field in flags.fields}
    for chosen in flags.fields:
        log = {field.name: field.reset for field in INTERFACE.telemetry("LogStatus").fields}
        for field in INTERFACE.telemetry("LogStatus").fields:
            if field.flag == chosen.name:
                log[field.name] = True
        packed = flags.pack(**{f.name: f is chosen for f in flags.fields})
        assert any(packed)
        assert INTERFACE.telemetry("LogStatus").pack(**log)[16:] == packed


@pytest.mark.parametrize(
    ("name", "values", "flag"),
    [
        ("setFocalLength", {"FocalLength": math.nan}, "FocalLengthRangeError"),
        ("setFocalLengthComponents", {"Fx": 1147.5, "Fy": 1e6}, "FocalLengthRangeError"),
        ("setPrincipalPoint", {"Cx": 5000.0, "Cy": 175.5}, "PrincipalPointRangeError"),
        ("CaptureTestPatern", {"TestPaternType": 9}, "TestPatternConfigError"),
        ("ImageBlockSet", {"BlockNumber": 0, "BlockSize": 4}, "ImageBlockSizeError"),
        ("ImageBlockSet", {"BlockNumber": 4096, "BlockSize": 2}, "ImageBlockSizeError"),
        ("setStarPixels", {"MinPixels": 7, "MaxPixels": 6}, "StarPixSetError"),
        ("setIDMode", {"IdMode": 2}, "SetIDModeError"),
        ("setTrackingMode", {"RightAscension": 0, "Declination": 1.6}, "DeclinationSetError"),
        ("setTrackingMode", {"RightAscension": 7, "Declination": 0}, "RightAscensionSetError"),
        ("WriteTo_IS_Register", {"Reg": 0, "DataH": 1, "DataL": 0}, "ISSetupError"),
        ("setIDMargin", {"Margin": 0.0}, ""),
    ],
)
def test_invalid_parameter_raises_the_flag_of_its_telecommand(
    name: str, values: dict[str, float], flag: str
) -> None:
    message = INTERFACE.telecommand(name)
    received = message.unpack(message.pack(**values))
    assert [found for _, found in message.violations(received)] == [flag]


@pytest.mark.parametrize(
    ("name", "field", "low", "high", "flag"),
    [
        ("setDelayTimerTimeout", "Time", 1, 100, "DelayTimeSetToLong"),
        ("setFocalLength", "FocalLength", 5, 7, "FocalLengthRangeError"),
        ("setDetectionRegion", "StepSize", 0, 10, "ValidImageRangeSetError"),
        ("setDetectionRegion", "Xend", 0, 1023, "ValidImageRangeSetError"),  # this sensor's
        ("setDetectionRegion", "Yend", 0, 511, "ValidImageRangeSetError"),
        ("setStarPixels", "MinPixels", 1, 100, "StarPixSetError"),
        ("setStarPixels", "MaxPixels", 1, 100, "StarPixSetError"),
        ("setDetectionVariables", "GridSize", 0, 15, "CentroidingGridSizeSetError"),
        ("setDetectionVariables", "MaxStars", 0, 99, "MaxStarsSetError"),
        ("setDetectionVariables", "MaxInvalidStars", 0, 15, ""),
    ],
)
def test_published_ranges_at_limits(name: str, field: str, low: int, high: int, flag: str) -> None:
    message = INTERFACE.telecommand(name)
    step = 1e-4 if message.field(field).type == "f32" else 1
    widest = {"MinPixels": 1, "MaxPixels": 100}
    usual = {name: widest.get(name, value) for name, value in message.reset_values().items()}
    for value, refused in ((low, 0), (high, 0), (low - step, 1), (high + step, 1)):
        if value >= 0:  # what an unsigned field can carry
            wrong = message.violations(message.unpack(message.pack(**usual | {field: value})))
            assert {found for _, found in wrong} == {flag} if refused else not wrong


def test_max_invalid_stars_accepts_the_published_50() -> None:
    message = INTERFACE.telecommand("setDetectionVariables")
    tried = {n: message.reset_values() | {"MaxInvalidStars": n} for n in range(256)}
    allowed = [n for n, values in tried.items() if not message.violations(values)]
    assert allowed == [*range(16), 50]


def test_detection_settings_name_their_flags() -> None:
    message = INTERFACE.telecommand("setDetectionVariables")
    wrong = {"GridSize": 16, "MaxStars": 100, "MaxInvalidStars": 0, "MaxNoise": 0}
    flags = [flag for _, flag in message.violations(wrong)]
    assert flags == ["CentroidingGridSizeSetError", "MaxStarsSetError", "MaxNoiseSetError"]
    region = INTERFACE.telecommand("setDetectionRegion")
    values = region.reset_values() | {"Xstart": 9, "Xend": 8}
    assert [flag for _, flag in region.violations(values)] == ["ValidImageRangeSetError"]


@pytest.mark.parametrize("size", ImageBlockSize)
def test_last_image_block_of_every_size_ends_with_the_image(size: ImageBlockSize) -> None:
    message = INTERFACE.telecommand("ImageBlockSet")
    last = 1024 * 512 // size.length - 1
    assert not message.violations({"BlockNumber": last, "BlockSize": size})
    assert message.violations({"BlockNumber": last + 1, "BlockSize": size})


def test_tracking_hint_accepts_poles_and_both_ra_conventions() -> None:
    message = INTERFACE.telecommand("setTrackingMode")
    for ra in (-math.pi, 0.0, 2 * math.pi):
        for dec in (-math.pi / 2, math.pi / 2):
            data = message.pack(RightAscension=ra, Declination=dec)
            assert not message.violations(message.unpack(data))


def test_interface_declares_stepping_and_unsupported_messages() -> None:
    assert {message.name for message in INTERFACE.messages if message.steps} == STEPPING
    unsupported = [message.id for message in INTERFACE.messages if not message.supported]
    assert unsupported == [138]
    assert INTERFACE.find(138) is None

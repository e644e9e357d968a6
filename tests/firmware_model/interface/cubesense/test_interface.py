"""The oracle is LAYOUTS: IDs, lengths, types and confidence as hosts of the CubeSpace family use
them, typed from their description. A telemetry ID counts without its bit 7.
"""

import math
from itertools import accumulate

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.cubesense import INTERFACE, codes, service_port, telemetry
from cubestack.firmware_model.interface.cubesense.registers import REGISTERS
from cubestack.firmware_model.interface.cubesense.telecommands import DISTORTION
from tests.together import together

LAYOUTS = """
TC 0 1 u8 H
TC 11 1 u8 L
TC 20 2 u8,u8 H
TC 21 3 u8,u8,u8 M
TC 40,41,42,44 1 u8 H
TC 43,45 5 u16,u8,u8,u8 H
TC 50,51 4 u16,u16 L
TC 52,53 9 u8,u16,u16,u16,u16 L
TC 54,55 15 u16,u8,u16,u8,u16,u8,u16,u8,u16,u8 L
TC 64 3 u8,u8,u8 H
TC 65 2 u16 H
TLM 0 8 u8,u8,u8,u8,u16,u16 H
TLM 1 6 bytes6 L
TLM 2 8 u16,u16,u8,u8,u8,u8 L
TLM 3 3 u8,u8,u8 H
TLM 20,21 6 i16,i16,u8,u8 M
TLM 22,23,24,25 6 i16,i16,u8,u8 H
TLM 26 10 u16,u16,u16,u16,u8,u8 H
TLM 40 14 u8,u8,u8,u16,u8,u8,u8,u8,u16,u8,u8,u8 H
TLM 64 128 bytes128 H
TLM 65 3 u16,u8 H
TLM 72,73 40 u16,u16,u16,u16,u16,u16,u16,u16,u16,u16,u16,u16,u16,u16,u16,u16,u16,u16,u16,u16 M
"""

KNOWN = {
    int(number) + (0x80 if kind == "TLM" else 0): layout
    for kind, numbers, *layout in map(str.split, LAYOUTS.strip().splitlines())
    for number in numbers.split(",")
}
BY_ID = {message.id: message for message in INTERFACE.messages}


@together("number", KNOWN)
def test_cubesense_messages_have_the_known_layout(number: int) -> None:
    length, types, confidence = KNOWN[number]
    message = BY_ID[number]
    assert (message.length, message.extension) == (int(length), False)
    # Signed mantissas are assumed: the description has an unsigned one and no sign.
    signless = ["u16" if f.name.startswith("Mantissa") else f.type for f in message.fields]
    assert signless == types.split(",")
    ends = [0, *accumulate(field.bits for field in message.fields)]
    assert [*(field.bit_offset for field in message.fields), 8 * message.length] == ends
    assert message.confidence.name[0] == confidence


def test_known_cubesense_messages_are_declared_and_extensions_in_range() -> None:
    ours = {message.id for message in INTERFACE.messages if message.extension}
    assert BY_ID.keys() - ours == KNOWN.keys()
    assert ours <= set(range(100, 128)) | set(range(220, 256))
    assert all(BY_ID[identifier].confidence is None for identifier in ours)


def test_cubesense_identification_has_seconds_before_milliseconds() -> None:
    values = INTERFACE.telemetry("Identification").unpack(bytes.fromhex("0502010300010200"))
    assert (values["RuntimeSeconds"], values["RuntimeMilliseconds"]) == (256, 2)
    assert (INTERFACE.name, INTERFACE.version) == ("CubeSense", 2)
    assert (INTERFACE.i2c_address, INTERFACE.baud) == (0x1B, 57_600)


@pytest.mark.parametrize(
    ("name", "parameters", "frame"),
    [
        ("CaptureAndDetect", {"Camera": 0, "Sram": 0}, "1F7F 14 00 00 1FFF"),
        (
            "CameraSettings2",
            {"Exposure": 0x1F1F, "Gain": 0x1F, "BlueGain": 0x80, "RedGain": 0x80},
            "1F7F 2D 1F1F 1F1F 1F1F 8080 1FFF",
        ),
        ("NextImageFrame", {"Frame": 31}, "1F7F 41 1F1F 00 1FFF"),
    ],
)
def test_telecommands_encode_to_the_published_bytes(
    name: str, parameters: dict[str, int], frame: str
) -> None:
    message = INTERFACE.telecommand(name)
    assert encode_frame(bytes([message.id]) + message.pack(**parameters)) == bytes.fromhex(frame)


def test_telemetry_encodes_to_the_published_bytes() -> None:
    result = INTERFACE.telemetry("Result1ThenSram1")
    assert (INTERFACE.telemetry("Identification").id, result.id) == (0x80, 0x96)
    data = bytes.fromhex("D204 C9FD 02 07")
    stored, success = codes.CaptureResult.STORED_OWN_SRAM, codes.DetectResult.SUCCESS
    values = {"Alpha": 12.34, "Beta": -5.67, "Capture": stored, "Detect": success}
    assert (result.pack(**values), result.unpack(data)) == (data, values)


@together(
    ("name", "change", "wrong"),
    [
        ("CaptureOnly", {"Location": codes.ImageLocation.BOTTOM}, ["Location"]),
        ("CaptureOnly", {"Camera": 2, "Sram": 2}, ["Camera", "Sram"]),
        ("StartImageDownload", {"Location": 1}, ["Location"]),
        ("StartImageDownload", {"Size": 5}, ["Size"]),
        ("NextImageFrame", {"Frame": 8192}, ["Frame"]),
        ("Reset", {"Target": 0}, ["Target"]),
        ("Reset", {"Target": 4}, ["Target"]),
        ("ClearOverCurrent", {"Selection": 3}, ["Selection"]),
        ("AutoAdjust1", {"Enabled": 2}, ["Enabled"]),
        ("Mask1", {"Area": 0}, ["Area"]),
        ("Mask2", {"Area": 6}, ["Area"]),
        ("Mask1", {"XMin": 9, "XMax": 8}, ["XMin"]),
        ("Mask1", {"XMax": 640}, ["XMax"]),
        ("Mask1", {"YMax": 480}, ["YMax"]),
        ("Boresight2", {"X": 640}, ["X"]),
        ("SetNadirSearch", {"Search": 3}, ["Search"]),
        ("CameraSettings1", {"Exposure": 65535, "Gain": 255}, []),
        ("Mask1", {"XMax": 639, "YMax": 479}, []),
        ("NextImageFrame", {"Frame": 8191}, []),
    ],
)
def test_bad_parameters_are_found(name: str, change: dict[str, int], wrong: list[str]) -> None:
    message = INTERFACE.telecommand(name)
    values = message.unpack(message.pack(**(message.reset_values() | change)))
    assert [field.name for field, _ in message.violations(values)] == wrong


def test_settings_have_the_published_reset_values() -> None:
    def resets(name: str) -> dict[str, object]:
        return dict(INTERFACE.telecommand(name).reset_values())

    assert resets("DetectionThreshold1") == {"Threshold": 225}
    assert resets("DetectionThreshold2") == {"Threshold": 70}
    assert resets("Boresight1") == {"X": 369.0, "Y": 250.0}
    assert resets("Boresight2") == {"X": 371.0, "Y": 236.0}
    assert resets("CameraSettings1")["Exposure"] == 1


def test_default_distortion_is_the_measured_one() -> None:
    values = INTERFACE.telecommand("Distortion2").reset_values()
    factors = [
        codes.coefficient(int(values[f"Mantissa{power}"]), int(values[f"Exponent{power}"]))
        for power in range(5)
    ]
    assert factors == pytest.approx(list(DISTORTION), rel=1.6e-4)
    radius = sum(factor * 182.0**power for power, factor in enumerate(factors))
    assert radius == pytest.approx(168.0, abs=0.5)  # CubeSense thesis, section 5.2


@given(st.floats(-32767, 32767).filter(lambda value: value == 0 or abs(value) > 1e-200))
def test_distortion_coefficients_survive_mantissa_and_exponent(value: float) -> None:
    mantissa, exponent = codes.split_coefficient(value)
    assert -32768 <= mantissa <= 32767
    assert 0 <= exponent <= 255
    assert codes.coefficient(mantissa, exponent) == pytest.approx(value, rel=1.6e-4)


def test_rejects_coefficients_out_of_range() -> None:
    for value in (32768.0, -1e9, math.inf, math.nan):
        with pytest.raises(ValueError, match="within \\+-32767"):
            codes.split_coefficient(value)
    assert codes.split_coefficient(1e-300) == (0, 255)


def test_enumerations_have_the_published_values() -> None:
    assert [result.value for result in codes.CaptureResult] == [0, 1, 2, 3, 4, 5]
    assert [result.value for result in codes.CaptureResult if result.stored] == [2, 3]
    names = "START_UP NONE_SCHEDULED PENDING TOO_MANY_EDGES TOO_FEW_EDGES BAD_FIT SUN_NOT_FOUND"
    assert [result.name for result in codes.DetectResult] == [*names.split(), "SUCCESS"]
    assert [target.value for target in codes.ResetTarget] == [1, 2, 3]
    assert [size.side for size in codes.ImageSize] == [1024, 512, 256, 128, 64]
    assert [size.frames for size in codes.ImageSize] == [8192, 2048, 512, 128, 32]


def test_results_schedule_the_four_combinations() -> None:
    assert telemetry.RESULTS == {codes.Camera.SUN: 0x80 + 20, codes.Camera.NADIR: 0x80 + 21}
    assert telemetry.SCHEDULES == {
        0x80 + 22: (codes.Camera.SUN, codes.Sram.SRAM1),
        0x80 + 23: (codes.Camera.NADIR, codes.Sram.SRAM2),
        0x80 + 24: (codes.Camera.SUN, codes.Sram.SRAM2),
        0x80 + 25: (codes.Camera.NADIR, codes.Sram.SRAM1),
    }
    assert [m.id for m in INTERFACE.messages if m.starts_measurement] == list(telemetry.SCHEDULES)
    assert {(m.camera, m.sram) for m in codes.Measurement} == set(telemetry.SCHEDULES.values())


def test_checksum_is_the_exclusive_or() -> None:
    assert codes.checksum(b"") == 0
    assert codes.checksum(bytes([0x0F, 0xF0, 0x3C])) == 0xC3


def test_registers_have_1_or_2_bytes_except_the_image_stream() -> None:
    assert REGISTERS is INTERFACE.registers
    assert codes.Measurement in INTERFACE.choices  # only registers use it
    assert REGISTERS.i2c_address == 0x1C
    assert [r.name for r in REGISTERS if r.length == 2] == ["SUN_X", "SUN_Y", "NADIR_X", "NADIR_Y"]
    assert [(r.name, r.length) for r in REGISTERS if r.length > 2] == [("IMAGE", 307_200)]
    assert all(2 < len(r.field.meaning) < 100 for r in REGISTERS)
    assert REGISTERS["NADIR_X"].encode(-12.34) == bytes.fromhex("FB2E")


def test_bench_letters_are_the_published_ones() -> None:
    assert service_port.SERVICE_PORT is INTERFACE.service_port
    assert service_port.SERVICE_PORT.baud == 115_200
    assert {
        letter.letter: (letter.length, letter.answer)
        for letter in service_port.SERVICE_PORT.letters
    } == {"a": (1, b"Y"), "q": (1, b"Y"), "s": (307_200, None), "w": (307_200, None)}
    for camera, letters in ((codes.Camera.NADIR, "as"), (codes.Camera.SUN, "qw")):
        ports = service_port.CAPTURES[camera], service_port.DOWNLOADS[camera]
        assert tuple(port.letter for port in ports) == tuple(letters)

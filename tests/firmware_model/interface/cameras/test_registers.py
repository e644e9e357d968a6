import dataclasses
from itertools import combinations
from types import ModuleType

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.interface.cameras import mlx75412, mt9m001, ov7620
from cubestack.firmware_model.interface.cameras.registers import (
    BitField,
    CameraRegister,
    CameraRegisterMap,
    UnknownRegisterError,
)

GAIN = CameraRegister(0x10, "GAIN", 5, "amplifies", width=2)
CONTROL = CameraRegister(0x12, "CONTROL", 0, "switches").of(
    BitField("ON", 0, 1, "runs"), BitField("DEPTH", 5, 2, "bits")
)


def registers(*declared: CameraRegister) -> CameraRegisterMap:
    return CameraRegisterMap("TEST1", 0x21, 2, declared)


def test_registers_are_found_by_name_and_by_any_of_their_addresses() -> None:
    table = registers(CONTROL, GAIN)
    assert table["GAIN"] is GAIN
    owners = [table.at(address) for address in range(0x0F, 0x14)]
    assert owners == [None, GAIN, GAIN, CONTROL, None]
    assert list(table) == [GAIN, CONTROL]  # in the order of addresses


@given(value=st.integers(0, 255))
def test_register_fields_extract_only_their_bits(value: int) -> None:
    assert CONTROL.field("ON").of(value) == value & 1
    assert CONTROL.field("DEPTH").of(value) == (value & 0x60) // 0x20
    assert CONTROL.field("DEPTH").mask == 0x60


def test_register_bits_combine_the_declared_fields() -> None:
    assert CONTROL.bits == 0x61
    assert GAIN.bits == 0xFFFF


def test_unknown_register_names_are_reported_with_known_ones() -> None:
    with pytest.raises(UnknownRegisterError, match=r"TEST1 has no register 'GAIM', only GAIN"):
        registers(GAIN)["GAIM"]
    with pytest.raises(UnknownRegisterError, match=r"no bit field .OF., only ON, DEPTH"):
        CONTROL.field("OF")
    with pytest.raises(UnknownRegisterError, match=r"only none"):
        GAIN.field("ON")


def test_rejects_overlapping_declarations() -> None:
    with pytest.raises(ValueError, match="GAIN and OTHER both have address 0x0011"):
        registers(GAIN, dataclasses.replace(CONTROL, name="OTHER", address=0x11))
    with pytest.raises(ValueError, match="declares register GAIN twice"):
        registers(GAIN, dataclasses.replace(GAIN, address=0x20))


@pytest.mark.parametrize("sensor", [mlx75412, mt9m001, ov7620], ids=lambda s: s.REGISTERS.camera)
def test_camera_register_tables_are_consistent(sensor: ModuleType) -> None:
    for register in sensor.REGISTERS:
        assert 0 <= register.reset < 1 << (register.unit_bits * register.width)
        if sensor is not ov7620:  # which has bits that are set and not declared
            assert register.reset & ~register.bits == 0
        masks = [field.mask for field in register.fields]
        assert not any(one & other for one, other in combinations(masks, 2))
        assert register.modelled or not any(field.modelled for field in register.fields)


# --- the cameras' tables, typed from their documents ----------------------------------------------

#: Addresses, OV7620 product specifications, revision 1.3.
OV7620 = {
    "GAIN": 0x00, "BLUE_GAIN": 0x01, "RED_GAIN": 0x02, "SATURATION": 0x03, "BRIGHTNESS": 0x06,
    "SHARPNESS": 0x07, "BLUE_BIAS": 0x0C, "RED_BIAS": 0x0D, "EXPOSURE": 0x10, "CLOCK_DIVIDER": 0x11,
    "COMMON_A": 0x12, "COMMON_B": 0x13, "COMMON_C": 0x14, "HSTART": 0x17, "HSTOP": 0x18,
    "VSTART": 0x19, "VSTOP": 0x1A, "COMMON_H": 0x28, "COMMON_I": 0x29, "FRAME_RATE_HIGH": 0x2A,
    "FRAME_RATE_LOW": 0x2B, "COMMON_J": 0x2D,
}  # fmt: skip

#: Name, first address and bytes, CubeStar thesis, appendix D.
MLX75412 = {
    "MODE_SELECT": (0x8100, 1), "HARDWARE_FEATURES": (0x8102, 1), "LINEARITY": (0x840B, 21),
    "EXPOSURE_RULE": (0x8444, 2), "SYNC": (0x8500, 1), "FIRMWARE_FEATURES": (0x8502, 1),
    "CLOCKS_PER_SECOND": (0x8518, 4), "FRAMES_PER_SECOND": (0x851C, 2), "EXPOSURE": (0x8526, 2),
}  # fmt: skip

#: Address and reset value, MT9M001 data sheet, register list.
MT9M001 = {
    "CHIP_VERSION": (0x00, 0x8431), "ROW_START": (0x01, 0x000C), "COLUMN_START": (0x02, 0x0014),
    "ROW_SIZE": (0x03, 0x03FF), "COLUMN_SIZE": (0x04, 0x04FF),
    "HORIZONTAL_BLANKING": (0x05, 0x0009), "VERTICAL_BLANKING": (0x06, 0x0019),
    "OUTPUT_CONTROL": (0x07, 0x0002), "SHUTTER_WIDTH": (0x09, 0x0419), "RESTART": (0x0B, 0x0000),
    "SHUTTER_DELAY": (0x0C, 0x0000), "RESET": (0x0D, 0x0000), "READ_OPTIONS_1": (0x1E, 0x8000),
    "READ_OPTIONS_2": (0x20, 0x1104), "GREEN_1_GAIN": (0x2B, 0x0008), "BLUE_GAIN": (0x2C, 0x0008),
    "RED_GAIN": (0x2D, 0x0008), "GREEN_2_GAIN": (0x2E, 0x0008), "GLOBAL_GAIN": (0x35, 0x0008),
    "BLACK_THRESHOLDS": (0x5F, 0x0904), "BLACK_CONTROL": (0x62, 0x0498),
    "CHIP_ENABLE": (0xF1, 0x0001),
}  # fmt: skip

#: Fields of one bit, with its number, in the same documents: camera, register, fields.
BITS = """
ov7620 COMMON_A RESET:7 MIRROR:6 AUTO_GAIN:5 AUTO_WHITE_BALANCE:2
ov7620 COMMON_B AUTO_ADJUST:0
ov7620 COMMON_C QVGA:5
ov7620 COMMON_H PROGRESSIVE:5
ov7620 COMMON_I MANUAL_EXPOSURE:7
mlx75412 MODE_SELECT ENABLE:0
mlx75412 FIRMWARE_FEATURES AUTOVIEW:7 AUTO_EXPOSURE:5
mlx75412 HARDWARE_FEATURES HISTOGRAM_REMAP:6
mt9m001 READ_OPTIONS_1 COLUMN_SKIP_4:2 ROW_SKIP_4:3 COLUMN_SKIP_8:4 ROW_SKIP_8:5
mt9m001 READ_OPTIONS_1 SNAPSHOT:8 STROBE:9 STROBE_WIDTH:10 STROBE_OVERRIDE:11
mt9m001 READ_OPTIONS_2 BAD_FRAMES:0 COLUMN_SKIP_2:3 ROW_SKIP_2:4
"""
CAMERAS = {"mlx75412": mlx75412, "mt9m001": mt9m001, "ov7620": ov7620}


@pytest.mark.parametrize("row", BITS.strip().splitlines())
def test_bits_are_where_they_are_published(row: str) -> None:
    camera, register, *bits = row.split()
    for field, _, bit in (each.partition(":") for each in bits):
        assert CAMERAS[camera].REGISTERS[register].field(field).mask == 1 << int(bit)


def test_ov7620_registers_have_their_published_addresses() -> None:
    assert {register.name: register.address for register in ov7620.REGISTERS} == OV7620
    assert {register.width for register in ov7620.REGISTERS} == {1}
    assert ov7620.REGISTERS["GAIN"].bits == 0x3F  # of eight
    assert (ov7620.REGISTERS.i2c_address << 1, ov7620.REGISTERS.address_bytes) == (0x42, 1)


def test_window_after_reset_is_the_whole_image() -> None:
    edges = [ov7620.REGISTERS[name].reset for name in ("HSTART", "HSTOP", "VSTART", "VSTOP")]
    assert edges == [0x2F, 0xCF, 0x05, 0xF5]
    assert (ov7620.window_column(323), ov7620.window_row(101)) == (0x2F + 80, 0x05 + 50)


def test_timing_after_reset_is_that_of_ccir_601() -> None:
    line_s = ov7620.CLOCKS_PER_LINE / ov7620.PIXEL_CLOCK_HZ
    assert ov7620.LINES_PER_FRAME * line_s == pytest.approx(33.37e-3, rel=1e-3)
    assert ov7620.EXPOSURE_LINES * line_s == pytest.approx(127e-6, rel=1e-3)
    # That holds for the reset values: clock undivided, rate unadjusted.
    names = ("CLOCK_DIVIDER", "FRAME_RATE_HIGH", "FRAME_RATE_LOW")
    assert [ov7620.REGISTERS[name].reset for name in names] == [0, 0, 0]


def test_published_mlx75412_registers_have_their_addresses_and_widths() -> None:
    assert {r.name: (r.address, r.width) for r in mlx75412.REGISTERS} == MLX75412
    assert mlx75412.REGISTERS.i2c_address == 0b0101100
    assert mlx75412.REGISTERS.at(0x841F) is mlx75412.REGISTERS["LINEARITY"]
    assert mlx75412.REGISTERS.at(0x8420) is None
    assert {r.name: (r.address, r.reset) for r in mt9m001.REGISTERS} == MT9M001
    assert mt9m001.REGISTERS.i2c_address == 0xBA >> 1
    assert mt9m001.REGISTERS.address_bytes == 1
    assert all(r.unit_bits == 16 and r.width == 1 for r in mt9m001.REGISTERS)


def test_mlx75412_registers_have_the_published_values() -> None:
    assert mlx75412.REGISTERS["CLOCKS_PER_SECOND"].reset == 0x019BFCC0
    assert mlx75412.REGISTERS["FRAMES_PER_SECOND"].reset == 0x001E
    assert mlx75412.LONGEST_EXPOSURE.to_bytes(2, "big") == b"\x00\x02"
    assert mlx75412.SYNC_APPLY == 0x03
    mode = mlx75412.REGISTERS["MODE_SELECT"]
    assert mode.field("OUTPUT_DEPTH").of(0x20) == 1  # bit 5 set, bit 6 clear: 8 bits
    features = mlx75412.REGISTERS["FIRMWARE_FEATURES"]
    assert features.field("BARRIER_UPDATE").mask | features.field("AUTO_DYNAMIC_RANGE").mask == 0x50


def test_only_mode_select_and_sync_act_at_once() -> None:
    assert {r.name for r in mlx75412.REGISTERS if not r.needs_sync} == {"MODE_SELECT", "SYNC"}


def test_mt9m001_frame_time_matches_the_published_one() -> None:
    line = mt9m001.COLUMNS + mt9m001.FRAME_START_CLOCKS + mt9m001.FRAME_END_CLOCKS
    assert line / mt9m001.PIXEL_CLOCK_HZ == pytest.approx(31.75e-6)
    assert (mt9m001.ROWS + 26) * line / mt9m001.PIXEL_CLOCK_HZ == pytest.approx(33.34e-3, abs=1e-5)


@pytest.mark.parametrize(
    ("register", "amplification"),
    [(0x08, 1.0), (0x20, 4.0), (0x51, 4.25), (0x60, 8.0), (0x61, 9.0), (0x67, 15.0)],
)
def test_mt9m001_gain_registers_have_the_published_gains(
    register: int, amplification: float
) -> None:
    assert mt9m001.gain(register) == amplification
    assert mt9m001.gain(mt9m001.gain_register(amplification)) == amplification


def test_gain_register_returns_the_nearest_gain_and_rejects_others() -> None:
    assert mt9m001.gain(mt9m001.gain_register(5.1)) == 5.0
    assert mt9m001.gain(mt9m001.gain_register(14.6)) == 15.0
    for wrong in (0.9, 15.1, float("nan")):
        with pytest.raises(ValueError, match=r"1\.\.15"):
            mt9m001.gain_register(wrong)

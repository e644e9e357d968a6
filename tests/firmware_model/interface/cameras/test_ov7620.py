import pytest

from cubestack.firmware_model.interface.cameras import ov7620

# Addresses of OV7620 product specifications, revision 1.3, typed from there.
PUBLISHED = {
    "GAIN": 0x00,
    "BLUE_GAIN": 0x01,
    "RED_GAIN": 0x02,
    "SATURATION": 0x03,
    "BRIGHTNESS": 0x06,
    "SHARPNESS": 0x07,
    "BLUE_BIAS": 0x0C,
    "RED_BIAS": 0x0D,
    "EXPOSURE": 0x10,
    "CLOCK_DIVIDER": 0x11,
    "COMMON_A": 0x12,
    "COMMON_B": 0x13,
    "COMMON_C": 0x14,
    "HSTART": 0x17,
    "HSTOP": 0x18,
    "VSTART": 0x19,
    "VSTOP": 0x1A,
    "COMMON_H": 0x28,
    "COMMON_I": 0x29,
    "FRAME_RATE_HIGH": 0x2A,
    "FRAME_RATE_LOW": 0x2B,
    "COMMON_J": 0x2D,
}

BITS = {
    ("COMMON_A", "RESET"): 0x80,
    ("COMMON_A", "MIRROR"): 0x40,
    ("COMMON_A", "AUTO_GAIN"): 0x20,
    ("COMMON_A", "AUTO_WHITE_BALANCE"): 0x04,
    ("COMMON_B", "AUTO_ADJUST"): 0x01,
    ("COMMON_C", "QVGA"): 0x20,
    ("COMMON_H", "PROGRESSIVE"): 0x20,
    ("COMMON_I", "MANUAL_EXPOSURE"): 0x80,
}


def test_every_register_is_where_it_is_published() -> None:
    assert {register.name: register.address for register in ov7620.REGISTERS} == PUBLISHED
    assert {register.width for register in ov7620.REGISTERS} == {1}
    assert ov7620.REGISTERS["GAIN"].bits == 0x3F  # of eight
    assert (ov7620.REGISTERS.i2c_address << 1, ov7620.REGISTERS.address_bytes) == (0x42, 1)


@pytest.mark.parametrize(("register", "field"), BITS)
def test_bits_are_where_they_are_published(register: str, field: str) -> None:
    assert ov7620.REGISTERS[register].field(field).mask == BITS[register, field]


def test_the_window_after_a_reset_is_the_whole_picture() -> None:
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

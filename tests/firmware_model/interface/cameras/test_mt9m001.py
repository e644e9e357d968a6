import pytest

from cubestack.firmware_model.interface.cameras import mt9m001

# MT9M001 data sheet, register list, typed from the text: address, reset value.
PUBLISHED = {
    "CHIP_VERSION": (0x00, 0x8431),
    "ROW_START": (0x01, 0x000C),
    "COLUMN_START": (0x02, 0x0014),
    "ROW_SIZE": (0x03, 0x03FF),
    "COLUMN_SIZE": (0x04, 0x04FF),
    "HORIZONTAL_BLANKING": (0x05, 0x0009),
    "VERTICAL_BLANKING": (0x06, 0x0019),
    "OUTPUT_CONTROL": (0x07, 0x0002),
    "SHUTTER_WIDTH": (0x09, 0x0419),
    "RESTART": (0x0B, 0x0000),
    "SHUTTER_DELAY": (0x0C, 0x0000),
    "RESET": (0x0D, 0x0000),
    "READ_OPTIONS_1": (0x1E, 0x8000),
    "READ_OPTIONS_2": (0x20, 0x1104),
    "GREEN_1_GAIN": (0x2B, 0x0008),
    "BLUE_GAIN": (0x2C, 0x0008),
    "RED_GAIN": (0x2D, 0x0008),
    "GREEN_2_GAIN": (0x2E, 0x0008),
    "GLOBAL_GAIN": (0x35, 0x0008),
    "BLACK_THRESHOLDS": (0x5F, 0x0904),
    "BLACK_CONTROL": (0x62, 0x0498),
    "CHIP_ENABLE": (0xF1, 0x0001),
}


def test_every_published_register_is_declared_where_it_is() -> None:
    assert {r.name: (r.address, r.reset) for r in mt9m001.REGISTERS} == PUBLISHED
    assert mt9m001.REGISTERS.i2c_address == 0xBA >> 1
    assert mt9m001.REGISTERS.address_bytes == 1
    assert all(r.unit_bits == 16 and r.width == 1 for r in mt9m001.REGISTERS)


# MT9M001 data sheet, bits of the registers of read options.
PUBLISHED_BITS = {
    "READ_OPTIONS_1": {
        "COLUMN_SKIP_4": 2,
        "ROW_SKIP_4": 3,
        "COLUMN_SKIP_8": 4,
        "ROW_SKIP_8": 5,
        "SNAPSHOT": 8,
        "STROBE": 9,
        "STROBE_WIDTH": 10,
        "STROBE_OVERRIDE": 11,
    },
    "READ_OPTIONS_2": {"BAD_FRAMES": 0, "COLUMN_SKIP_2": 3, "ROW_SKIP_2": 4},
}


@pytest.mark.parametrize("name", list(PUBLISHED_BITS))
def test_published_switches_are_one_bit_each(name: str) -> None:
    masks = {field.name: field.mask for field in mt9m001.REGISTERS[name].fields}
    for field, bit in PUBLISHED_BITS[name].items():
        assert masks[field] == 1 << bit


def test_published_frame_time() -> None:
    line = mt9m001.COLUMNS + mt9m001.FRAME_START_CLOCKS + mt9m001.FRAME_END_CLOCKS
    assert line / mt9m001.PIXEL_CLOCK_HZ == pytest.approx(31.75e-6)
    assert (mt9m001.ROWS + 26) * line / mt9m001.PIXEL_CLOCK_HZ == pytest.approx(33.34e-3, abs=1e-5)


@pytest.mark.parametrize(
    ("register", "amplification"),
    [(0x08, 1.0), (0x20, 4.0), (0x51, 4.25), (0x60, 8.0), (0x61, 9.0), (0x67, 15.0)],
)
def test_published_gains(register: int, amplification: float) -> None:
    assert mt9m001.gain(register) == amplification
    assert mt9m001.gain(mt9m001.gain_register(amplification)) == amplification


def test_the_nearest_gain_is_found_and_others_refused() -> None:
    assert mt9m001.gain(mt9m001.gain_register(5.1)) == 5.0
    assert mt9m001.gain(mt9m001.gain_register(14.6)) == 15.0
    for wrong in (0.9, 15.1, float("nan")):
        with pytest.raises(ValueError, match=r"1\.\.15"):
            mt9m001.gain_register(wrong)

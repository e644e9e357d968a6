"""The command table against table 6.4 as printed, and the published read-outs."""

from dataclasses import replace
from itertools import product

import pytest

from cubestack.firmware_model.interface.cubesense import fpga

# SHIFT EDGE RNW SUNEN NADEN, then what the sun's and the nadir's FPGA do.
PRINTED = {
    "00001": (fpga.Action.STORE, fpga.Action.STANDBY),
    "00010": (fpga.Action.STANDBY, fpga.Action.STORE),
    "00101": (fpga.Action.READ, fpga.Action.STANDBY),
    "00110": (fpga.Action.STANDBY, fpga.Action.READ),
    "01101": (fpga.Action.EDGE, fpga.Action.STANDBY),
    "01110": (fpga.Action.STANDBY, fpga.Action.EDGE),
    "10000": (fpga.Action.SEND_PICTURE, fpga.Action.STORE_OTHER),
    "10100": (fpga.Action.STORE_OTHER, fpga.Action.SEND_PICTURE),
    "11000": (fpga.Action.PASS_EDGE, fpga.Action.SEND_EDGE),
    "11100": (fpga.Action.SEND_EDGE, fpga.Action.PASS_EDGE),
}
OURS = {"00000": (fpga.Action.STORE, fpga.Action.STORE)}
ADDRESSING = {
    "01001": (fpga.Action.TAKE_ADDRESS, fpga.Action.STANDBY),
    "01010": (fpga.Action.STANDBY, fpga.Action.TAKE_ADDRESS),
    "11001": (fpga.Action.READ_FROM, fpga.Action.STANDBY),
    "11010": (fpga.Action.STANDBY, fpga.Action.READ_FROM),
}


@pytest.mark.parametrize("mcu_addressing", [False, True])
def test_fpga_levels_outside_the_printed_rows_are_standby(mcu_addressing: bool) -> None:
    listed = PRINTED | OURS | (ADDRESSING if mcu_addressing else {})
    for levels in product("01", repeat=5):
        expected = listed.get("".join(levels), (fpga.Action.STANDBY, fpga.Action.STANDBY))
        found = fpga.actions(*map(int, levels), mcu_addressing=mcu_addressing)
        assert found == expected, levels


def test_fpga_commands_have_distinct_pin_levels() -> None:
    for levels in product((0, 1), repeat=5):
        commands = fpga.COMMANDS + fpga.ADDRESSING_COMMANDS
        assert sum(command.fits(*levels) for command in commands) <= 1


def test_addressing_commands_show_the_other_enable_and_change_only_shift() -> None:
    for command in fpga.ADDRESSING_COMMANDS:
        assert fpga.link_shows_enables(command.shift or 0, command.edge or 0)
    rows = {(c.edge, c.rnw) for c in fpga.ADDRESSING_COMMANDS}
    assert len(rows) == 1


@pytest.mark.parametrize(
    ("pixel", "sent"),
    [((0, 0), "000000"), ((639, 0), "00027f"), ((0, 1), "000400"), ((639, 479), "077e7f")],
)
def test_address_is_row_and_column_highest_byte_first(pixel: tuple[int, int], sent: str) -> None:
    assert fpga.address_bytes(*pixel).hex() == sent


@pytest.mark.parametrize("pixel", [(640, 0), (0, 480), (-1, 0), (0, -1)])
def test_rejects_address_outside_the_image(pixel: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="not inside of 640 x 480 pixels"):
        fpga.address_bytes(*pixel)


def test_enables_are_hidden_exactly_while_the_link_carries_the_image() -> None:
    hidden = [pair for pair in product((0, 1), repeat=2) if not fpga.link_shows_enables(*pair)]
    assert hidden == [(1, 0)]
    crosses = {fpga.Action.SEND_PICTURE, fpga.Action.STORE_OTHER}
    for command in fpga.COMMANDS:
        assert ((command.shift, command.edge) in hidden) == (crosses == set(command.actions))


def test_at_most_one_fpga_drives_the_mcu_bus() -> None:
    drivers = {fpga.Action.READ, fpga.Action.EDGE, fpga.Action.PASS_EDGE, fpga.Action.READ_FROM}
    for command in fpga.COMMANDS + fpga.ADDRESSING_COMMANDS:
        driving = [action for action in command.actions if action in drivers]
        assert len(driving) <= 1
        assert command.shift or command.rnw or not driving, "the microcontroller may drive here"


def test_link_commands_pair_sending_and_receiving_actions() -> None:
    pairs = {
        fpga.Action.SEND_PICTURE: fpga.Action.STORE_OTHER,
        fpga.Action.SEND_EDGE: fpga.Action.PASS_EDGE,
    }
    for command in fpga.COMMANDS:
        for one, other in (command.actions, fpga.Actions(*command.actions[::-1])):
            assert one not in pairs or other is pairs[one]


def test_full_size_scan_visits_the_published_pixels() -> None:
    assert list(fpga.FULL_SIZE.scan_rows) == [15, 79, 143, 207, 271, 335, 399, 463]
    assert list(fpga.FULL_SIZE.scan_columns) == [63, 127, 191, 255, 319, 383, 447, 511, 575, 639]
    pixels = list(fpga.FULL_SIZE.scan())
    assert len(pixels) == fpga.FULL_SIZE.scan_clocks == 1 + 8 * 640 + 1 + 10 * 480
    assert [index for index, pixel in enumerate(pixels) if pixel is None] == [0, 5121]
    assert pixels[1:3] == [(0, 15), (1, 15)]
    assert pixels[5120] == (639, 463)
    assert pixels[5122:5124] == [(63, 0), (63, 1)]
    assert pixels[-1] == (639, 479)


@pytest.mark.parametrize(
    ("sun", "origin"),
    [
        ((300, 200), (295, 197)),
        ((5, 3), (0, 0)),
        ((0, 0), (0, 0)),
        ((6, 2), (1, 0)),
        ((630, 468), (625, 465)),
        ((637, 479), (625, 465)),
        (fpga.SUN_NOT_FOUND, (625, 465)),
    ],
)
def test_sun_window_is_inside_the_image(sun: tuple[int, int], origin: tuple[int, int]) -> None:
    assert fpga.FULL_SIZE.window_origin(*sun) == origin


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"scan_step": 48}, "power of two"),
        ({"first_row": 64}, "below scan_step 64"),
        ({"first_column": 100}, "below scan_step 64"),
        ({"columns": 63}, "inside of the image"),
        ({"rows": 16, "window": 17}, "does not fit into 640 x 16"),
    ],
)
def test_read_out_rejects_impossible_dimensions(change: dict[str, int], error: str) -> None:
    with pytest.raises(ValueError, match=error):
        fpga.ReadOut(**change)


def test_as_printed_scan_ends_at_an_existing_address() -> None:
    """The column behind the last one, modulo what the counter holds."""
    flown = replace(fpga.FULL_SIZE, as_printed=True)
    assert [*flown.scan()][-1] == (703, 0)
    small = fpga.ReadOut(
        columns=32, rows=20, scan_step=8, first_row=3, first_column=7, window=7, as_printed=True
    )
    assert [*small.scan()][-1] == (7, 0)  # 39 of a counter of 5 bits

"""Pictures in FITS, by bytes as sections 3 to 5 of the standard describe them."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.emulator.scene.file import SceneError
from cubestack.emulator.scene.fits import PIXELS, read_fits
from cubestack.emulator.scene.picture import load_picture

MOST = 1_000_000
ROWS, COLUMNS = 5, 7


def block(content: bytes, fill: bytes) -> bytes:
    return content + fill * (-len(content) % 2880)


def header(first: str, **cards: object) -> bytes:
    lines = [first, *(f"{name:<8}= {value!s:>20} / a comment" for name, value in cards.items())]
    return block("".join(line.ljust(80)[:80] for line in (*lines, "END")).encode(), b" ")


def image(bits: int, values: NDArray[np.float64], first: str = "", **more: object) -> bytes:
    """A unit with an image of two axes."""
    rows, columns = values.shape
    sizes = {"BITPIX": bits, "NAXIS": 2, "NAXIS1": columns, "NAXIS2": rows}
    head = header(first or "SIMPLE  =                    T", **(sizes | more))
    return head + block(values.astype(PIXELS[bits]).tobytes(), b"\0")


def ramp(most: int) -> NDArray[np.float64]:
    return np.rint(np.linspace(0, most, ROWS * COLUMNS)).reshape(ROWS, COLUMNS)


@pytest.mark.parametrize("bits", PIXELS)
@pytest.mark.parametrize("top_down", [False, True])
def test_first_row_is_the_lowest_unless_the_header_says_otherwise(
    bits: int, top_down: bool
) -> None:
    values = ramp(100)
    more = {"ROWORDER": "'TOP-DOWN'"} if top_down else {}
    found = read_fits(image(bits, values, **more), "x", MOST)
    np.testing.assert_array_equal(found, values if top_down else values[::-1])


def test_values_of_16_bits_are_unsigned_by_their_zero() -> None:
    values = ramp(0xFFFF)
    found = read_fits(image(16, values - 32768, BZERO=32768, BSCALE=1), "x", MOST)
    np.testing.assert_array_equal(found, values[::-1])
    halves = read_fits(image(16, values // 4, BSCALE="2.0D0"), "x", MOST)
    np.testing.assert_array_equal(halves, values[::-1] // 4 * 2)


def test_negative_values_are_dark() -> None:
    assert read_fits(image(-32, ramp(9) - 20), "x", MOST).max() == 0


def test_image_may_follow_other_units() -> None:
    table = header("XTENSION= 'BINTABLE'", BITPIX=8, NAXIS=2, NAXIS1=4, NAXIS2=3, PCOUNT=3000)
    content = header("SIMPLE  =                    T", BITPIX=8, NAXIS=0)
    content += table + bytes(2 * 2880) + image(8, ramp(50), "XTENSION= 'IMAGE   '", PCOUNT=0)
    np.testing.assert_array_equal(read_fits(content, "x", MOST), ramp(50)[::-1])


def test_12_bits_in_use_are_recognised(tmp_path: Path) -> None:
    (tmp_path / "a.fits").write_bytes(image(16, ramp(4095)))
    np.testing.assert_array_equal(load_picture(tmp_path / "a.fits"), ramp(4095)[::-1] // 16)


FIRST = "SIMPLE  =                    T"


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (FIRST.encode(), "ends within a header"),
        (FIRST.ljust(80).encode() * 5000, "a header has more than 100 blocks"),
        (header(FIRST, BITPIX=8, NAXIS=10**9), "NAXIS is not a whole number up to 999"),
        (header(FIRST, BITPIX=8, NAXIS=999), "no image of two axes"),
        (header(FIRST, BITPIX=8, NAXIS=0) * 200, "its first 100 units"),
        (header(FIRST, BITPIX=8, NAXIS=2, NAXIS1="9" * 60, NAXIS2=1), "NAXIS1 is not a whole"),
        (header(FIRST, BITPIX=8, NAXIS=2, NAXIS1=-5, NAXIS2=2), "an axis is negative"),
        (header(FIRST, BITPIX=8, NAXIS=2, NAXIS1=10**5, NAXIS2=10**5), "100000 x 100000 pixels"),
        (header(FIRST, BITPIX=8, NAXIS=2, NAXIS1=10, NAXIS2=10), "its values end before"),
        (header(FIRST, BITPIX=7, NAXIS=2, NAXIS1=10, NAXIS2=10), "BITPIX is none of 8, 16"),
        (image(8, ramp(9), BSCALE="'\x1b'"), "BSCALE is not a number"),
        (image(-32, np.full((2, 2), np.nan)), "values beyond 0 to 65535"),
        (image(8, ramp(200), BSCALE="1E300"), "values beyond 0 to 65535"),
        (image(64, ramp(70_000)), "values beyond 0 to 65535"),
        (image(8, ramp(9), "XTENSION= 'BINTABLE'", ZIMAGE="T"), "that is not compressed"),
    ],
    ids=range(15),
)
def test_damaged_and_hostile_files_are_refused_in_one_line(content: bytes, words: str) -> None:
    with pytest.raises(SceneError, match=words) as refused:
        read_fits(content, "x", MOST)
    assert str(refused.value).isprintable()

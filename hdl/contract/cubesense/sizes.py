"""Sizes of the pair in its contract: of the image, and of the read-outs in it."""

from dataclasses import asdict

from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, ReadOut
from cubestack.hdl.contract.contract import Size

FULL_IMAGE = Size(FULL_SIZE.columns, FULL_SIZE.rows)

#: The fields of :class:`ReadOut` that a design may have as parameters, in capitals.
_PARAMETERS = asdict(FULL_SIZE).keys() - {"as_printed", "one_search"}


def read_out(size: Size) -> ReadOut:
    """With a gap, a scan and a window that fit a small image."""
    if size == FULL_IMAGE:
        return FULL_SIZE
    window = min(5, *size)
    gap = 9 if window == 5 else 1
    return ReadOut(*size, gap, 2, 1, 1, window, window_left=1, window_above=window // 2)


def parameters(size: Size) -> dict[str, int]:
    return {
        name.upper(): value for name, value in asdict(read_out(size)).items() if name in _PARAMETERS
    }


def not_found(size: Size) -> tuple[int, int]:
    """x and y of an image without a Sun pixel: all bits of an address."""
    return (1 << (size.columns - 1).bit_length()) - 1, (1 << (size.rows - 1).bit_length()) - 1

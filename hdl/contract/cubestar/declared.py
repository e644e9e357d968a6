"""The contract of CubeStar's published board, as data."""

from pathlib import Path

from cubestack.firmware_model.interface.cubestar.pins import PUBLISHED
from cubestack.firmware_model.interface.pins import Pin, resized
from cubestack.hdl.blocks.counters import MatrixCounter
from cubestack.hdl.contract.contract import FULL, QUICK, Check, Contract, Size
from cubestack.hdl.contract.cubestar.points import POINTS
from cubestack.hdl.contract.cubestar.properties import PROPERTIES
from cubestack.hdl.cubestar.top import CubeStarTop

#: A camera, an SRAM and a data clock in Verilog, for an image of full size.
FULL_FRAME = Path(__file__).with_name("full_frame.v")

_HERE = "cubestack.hdl.contract.cubestar"
_TESTS = f"{_HERE}.testbenches"

CHECKS = {
    "stores_and_reads_back": Check(
        "A whole frame is stored in either bank, acknowledged, and read byte by byte", _TESTS
    ),
    "acknowledges_only_whole_frames": Check(
        "ACK rises only when all rows of one frame are in the memory", _TESTS
    ),
    "last_row_too_short": Check("A frame whose last row is too short is not acknowledged", _TESTS),
    "surplus_pixels_are_not_stored": Check(
        "Surplus pixels and rows are not stored, and nothing is after ACK", _TESTS
    ),
    "aborted_at_any_moment": Check(
        "A store that is aborted at any moment leaves a design that works", _TESTS
    ),
    "aborted_early": Check(
        "An aborted store writes only whole pulses at addresses of its image",
        _TESTS,
        whole_frames=False,
    ),
    "outputs_rest_in_standby": Check(
        "In standby all outputs rest, whatever the camera does", _TESTS, whole_frames=False
    ),
    "reads_without_a_camera": Check(
        "Reading works when the camera gives no pixel clock", _TESTS, whole_frames=False
    ),
    "writes_nothing_while_reading": Check(
        "Nothing is written while an image is read", _TESTS, whole_frames=False
    ),
    "bank_is_latched": Check("The rising ENABLE latches BANK", _TESTS, whole_frames=False),
    "stores_and_reads_a_whole_frame": Check(
        "A frame of full size is stored at the right addresses, and read byte by byte",
        f"{_HERE}.whole_frame",
        FULL,
        harness=FULL_FRAME,
    ),
}


_CAMERA = (("PIXCLK",), "the camera changes it with PIXCLK")
_PROCESSOR = "the microcontroller changes one pin after the other"

INPUTS = {
    "PIXDATA": _CAMERA,
    "HSYNC": _CAMERA,
    "VSYNC": _CAMERA,
    "ENABLE": (("DCLK",), _PROCESSOR),
    "RNW": (("DCLK", "ENABLE"), _PROCESSOR),
    "BANK": (("DCLK", "ENABLE"), "stable around the rising ENABLE"),
    "SRAM_D_I": (("DCLK", "PIXCLK"), "the SRAM follows the address, which that clock sets"),
}


def _pins(size: Size) -> tuple[Pin, ...]:
    return resized(PUBLISHED, SRAM_A=MatrixCounter.address_width(*size) + 1)


CONTRACT = Contract(
    title="CubeStar frame buffer",
    pins=_pins,
    shipped=lambda size: CubeStarTop(*size),
    full=Size(1024, 512),
    small={QUICK: (Size(8, 4),), FULL: (Size(8, 4), Size(4, 2), Size(16, 8))},
    proof=Size(2, 2),
    parameters=lambda size: {"COLUMNS": size.columns, "ROWS": size.rows},
    checks=CHECKS,
    points=POINTS,
    properties=PROPERTIES,
    inputs=INPUTS,
    stable={"ENABLE": "what the rising ENABLE latches does not change while it is high"},
)

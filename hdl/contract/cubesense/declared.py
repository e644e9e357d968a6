"""The contract of CubeSense's pair, and of one of its FPGAs, as data."""

from functools import partial
from pathlib import Path

from cubestack.firmware_model.interface.cubesense.pins import FPGA, pair_pins
from cubestack.firmware_model.interface.pins import Pin, resized
from cubestack.hdl.blocks.counters import MatrixCounter
from cubestack.hdl.contract.contract import FULL, QUICK, Check, Contract, Size
from cubestack.hdl.contract.cubesense.points import POINTS
from cubestack.hdl.contract.cubesense.properties import PROPERTIES
from cubestack.hdl.contract.cubesense.sizes import FULL_IMAGE, parameters, read_out
from cubestack.hdl.cubesense.dataflow import Side
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubesense.top import CubeSenseFpga

_HERE = "cubestack.hdl.contract.cubesense"
_TESTS, _EDGE = f"{_HERE}.testbenches", f"{_HERE}.edge_data"

CHECKS = {
    "stores_and_reads_back": Check(
        "A whole frame is stored in either memory, also across the link, and read byte by byte",
        _TESTS,
    ),
    "stores_both_at_once": Check("Both sides store at once", _TESTS),
    "acknowledges_only_whole_frames": Check(
        "ACK rises only when all rows of one frame, which begins after a gap, are in the memory",
        _TESTS,
    ),
    "a_pause_is_no_gap": Check("A pause that is not longer than the gap begins no frame", _TESTS),
    "last_row_too_short": Check("A frame whose last row is too short is not acknowledged", _TESTS),
    "surplus_pixels_are_not_stored": Check(
        "Surplus pixels and rows are not stored, and nothing is after ACK", _TESTS
    ),
    "aborted_at_any_moment": Check(
        "A store that is aborted at any moment leaves a design that works", _TESTS
    ),
    "works_with_a_dead_camera": Check(
        "If a camera gives no pixel clock, the other one's image is stored in either memory", _TESTS
    ),
    "presents_the_sun_window": Check(
        "The coordinates of the first Sun pixel and the window around it are read from either "
        "memory",
        _EDGE,
    ),
    "keeps_the_sun_pixel": Check(
        "The coordinates stay until the next Sun image is stored in that memory", _EDGE
    ),
    "presents_the_nadir_scan": Check(
        "The nadir scan presents its rows and columns from either memory", _EDGE, whole_frames=False
    ),
    "rows_are_stored_at_their_addresses": Check(
        "Rows are stored at their addresses, and without a whole frame ACK stays low",
        _TESTS,
        whole_frames=False,
    ),
    "outputs_rest_in_standby": Check(
        "In standby, and at levels that are no command, nothing is written and no pin is active",
        _TESTS,
        whole_frames=False,
    ),
    "reads_without_a_camera": Check(
        "Reading works when no camera gives a pixel clock", _TESTS, whole_frames=False
    ),
    "writes_nothing_while_reading": Check(
        "Nothing is written while an image is read", _TESTS, whole_frames=False
    ),
    "stores_and_reads_whole_frames": Check(
        "Frames of full size are stored, also across the link, and read in all three orders",
        f"{_HERE}.whole_frame",
        FULL,
        harness=Path(__file__).with_name("cubesense_full_frame.v"),
    ),
}


def _pins(size: Size) -> tuple[Pin, ...]:
    width = MatrixCounter.address_width(*size)
    return resized(pair_pins(), SUN_SRAM_A=width, NAD_SRAM_A=width)


CONTRACT = Contract(
    title="CubeSense pair of FPGAs",
    pins=_pins,
    shipped=lambda size: CubeSensePair(read_out(size)),
    full=FULL_IMAGE,
    small={QUICK: (Size(11, 5),), FULL: (Size(11, 5), Size(16, 8))},
    proof=Size(3, 2),
    parameters=parameters,
    checks=CHECKS,
    points=POINTS,
    properties=PROPERTIES,
)

_PROCESSOR = (("CLK",), "the microcontroller changes one line after the other")
_LINK = (("LINK_C_I",), "the other FPGA sends it with its clock")
_STABLE = "a data clock reads it long after the pixel clock has written it"


def fpga_contract(side: Side) -> Contract:
    """Of one FPGA: the clocks of its inputs."""
    return Contract(
        title=f"CubeSense, {side} sensor's FPGA",
        pins=lambda size: resized(FPGA, SRAM_A=MatrixCounter.address_width(*size)),
        shipped=partial(_fpga, side),
        full=FULL_IMAGE,
        small={},
        proof=Size(11, 5),
        parameters=lambda size: {},
        inputs={
            "Y": (("PCLK",), "the camera changes it with PCLK"),
            "HREF": (("PCLK",), "the camera changes it with PCLK"),
            "LINK_D_I": _LINK,
            "LINK_C_I": (("LINK_C_I", "CLK"), "the other FPGA's clock, row signal and enable"),
            **dict.fromkeys(("EN", "RNW", "EDGE", "SHIFT"), _PROCESSOR),
            "SRAM_D_I": (("CLK",), "the SRAM follows the address, which CLK sets"),
        },
        allowed={("x", "data"): _STABLE, ("y", "data"): _STABLE},
    )


def _fpga(side: Side, size: Size) -> CubeSenseFpga:
    return CubeSenseFpga(side, read_out(size))

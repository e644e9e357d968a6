"""The contract of CubeSense's pair, and of one of its FPGAs, as data."""

from functools import partial

from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, ReadOut
from cubestack.firmware_model.interface.cubesense.pins import FPGA, pair_pins
from cubestack.firmware_model.interface.pins import Pin, resized
from cubestack.hdl.blocks.counters import MatrixCounter
from cubestack.hdl.contract.contract import FULL, QUICK, Check, Contract, Size
from cubestack.hdl.contract.cubesense.points import POINTS
from cubestack.hdl.contract.cubesense.properties import PROPERTIES
from cubestack.hdl.cubesense.dataflow import Side
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubesense.top import CubeSenseFpga

_TESTS = "cubestack.hdl.contract.cubesense.testbenches"

CHECKS = {
    "stores_and_reads_back": Check(
        "A whole frame is stored in a side's own memory, acknowledged, and read byte by byte",
        _TESTS,
    ),
    "aborted_at_any_moment": Check(
        "A store that is aborted at any moment leaves a design that works", _TESTS
    ),
    "rows_are_stored_at_their_addresses": Check(
        "Rows are stored at their addresses, and without a whole frame ACK stays low",
        _TESTS,
        whole_frames=False,
    ),
    "outputs_rest_in_standby": Check(
        "In standby nothing is written and no pin is active", _TESTS, whole_frames=False
    ),
    "reads_without_a_camera": Check(
        "Reading works when no camera gives a pixel clock", _TESTS, whole_frames=False
    ),
    "writes_nothing_while_reading": Check(
        "Nothing is written while an image is read", _TESTS, whole_frames=False
    ),
}

_FULL = Size(FULL_SIZE.columns, FULL_SIZE.rows)


def _read_out(size: Size) -> ReadOut:
    """With a gap, a scan and a window that fit a small image."""
    if size == _FULL:
        return FULL_SIZE
    return ReadOut(
        *size, frame_gap(size), scan_step=2, first_row=1, first_column=1, window=5, window_left=1
    )


def frame_gap(size: Size) -> int:
    """Clocks of low HREF that mark a frame."""
    return FULL_SIZE.frame_gap if size == _FULL else 9


def _pins(size: Size) -> tuple[Pin, ...]:
    width = MatrixCounter.address_width(*size)
    return resized(pair_pins(), SUN_SRAM_A=width, NAD_SRAM_A=width)


CONTRACT = Contract(
    title="CubeSense pair of FPGAs",
    pins=_pins,
    shipped=lambda size: CubeSensePair(_read_out(size)),
    full=_FULL,
    small={QUICK: (Size(11, 5),), FULL: (Size(11, 5), Size(16, 8))},
    proof=Size(11, 5),
    parameters=lambda size: {
        "COLUMNS": size.columns,
        "ROWS": size.rows,
        "FRAME_GAP": frame_gap(size),
    },
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
        full=_FULL,
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
    return CubeSenseFpga(side, _read_out(size))

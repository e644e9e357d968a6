"""CubeSense's tops with their clocks, and its blocks, by their names on the command line."""

from functools import partial
from pathlib import Path

from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE, READ_OUTS, ReadOut
from cubestack.firmware_model.interface.cubesense.pins import CLK, PCLK
from cubestack.hdl.blocks.counters import GrayCounter, MatrixCounter
from cubestack.hdl.blocks.frames import FrameGap, FrameWriter
from cubestack.hdl.cubesense.dataflow import SIDES, Side
from cubestack.hdl.cubesense.nadir_scan import NadirScan
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubesense.reader import CubeSenseReader
from cubestack.hdl.cubesense.sun_search import SunSearch
from cubestack.hdl.cubesense.sun_window import SunWindow
from cubestack.hdl.cubesense.top import CubeSenseFpga
from cubestack.hdl.flow.top import Block, Clock, Top, TopTable

PIXEL_CLOCK = Clock(PCLK, 74, "OV7620 at 13.5 MHz")
LINK_CLOCK = Clock("LINK_C[0]", 74, "the other camera's PCLK, over the link")
_CLK = Clock(CLK, 400, "two instructions of the microcontroller at 5 MHz")

_OPTION = ", the microcontroller sets the address"
_AS_PRINTED = READ_OUTS["both-searches"]
_VARIANTS = {name: READ_OUTS[name] for name in ("both-searches", "one-search")}


def _title(mcu_addressing: bool, read_out: ReadOut) -> str:
    variant = ", as printed" * read_out.as_printed + ", with one search" * read_out.one_search
    return _OPTION * mcu_addressing + variant


def _fpga(side: Side, mcu_addressing: bool = False, read_out: ReadOut = FULL_SIZE) -> Top:
    return Top(
        partial(CubeSenseFpga, side, read_out, mcu_addressing),
        f"CubeSense, {side} sensor's FPGA{_title(mcu_addressing, read_out)}",
        (PIXEL_CLOCK, LINK_CLOCK, _CLK),
        pulled_up=("LINK_C",),
        fits=not read_out.as_printed or read_out.one_search,
    )


def _pair(mcu_addressing: bool) -> Top:
    return Top(
        partial(CubeSensePair, FULL_SIZE, mcu_addressing),
        f"CubeSense, model of both FPGAs and their link{_OPTION * mcu_addressing}",
        (*(PIXEL_CLOCK._replace(port=f"{half}_PCLK") for half in ("SUN", "NAD")), _CLK),
        parts=2,
    )


_EDGE_BLOCKS = {"nadir scan": NadirScan, "Sun search": SunSearch, "Sun window": SunWindow}

#: Recorded area of the designs: output of ``cubestack hdl area --ice40 --fmax --json``.
AREA_FILE = Path(__file__).parent / "area.json"

TOPS: TopTable = {
    **{
        f"cubesense-{side}{'-addressing' * addressing}": _fpga(side, addressing)
        for addressing in (False, True)
        for side in SIDES
    },
    **{
        f"cubesense-{side}-{variant}": _fpga(side, read_out=read_out)
        for variant, read_out in _VARIANTS.items()
        for side in SIDES
    },
    "cubesense-pair": _pair(mcu_addressing=False),
    "cubesense-pair-addressing": _pair(mcu_addressing=True),
    "matrix counter 640 x 480": Block(partial(MatrixCounter, 640, 480)),
    "Gray counter of 307200": Block(partial(GrayCounter, 640 * 480)),
    "frame writer 640 x 480": Block(partial(FrameWriter, 640, 480)),
    "frame gap of 858 clocks": Block(partial(FrameGap, 858)),
    **{
        f"{name}{', as printed' * size.as_printed}": Block(partial(make, size))
        for size in (FULL_SIZE, _AS_PRINTED)
        for name, make in _EDGE_BLOCKS.items()
    },
    "CubeSense reader": Block(partial(CubeSenseReader, FULL_SIZE)),
    "the same, addressing": Block(partial(CubeSenseReader, FULL_SIZE, mcu_addressing=True)),
}

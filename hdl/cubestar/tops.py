"""CubeStar's tops with their clocks, and its blocks, by their names on the command line."""

from functools import partial
from pathlib import Path

from cubestack.firmware_model.interface.cubestar.pins import ALE, DCLK, ENABLE, PIXCLK, RNW
from cubestack.hdl.blocks.counters import MatrixCounter
from cubestack.hdl.blocks.frames import FrameReader, FrameWriter
from cubestack.hdl.cubestar.double_top import CubeStarDouble
from cubestack.hdl.cubestar.shared_top import CubeStarShared, CubeStarTwoBoards
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.flow.top import Block, Clock, Top, TopTable

_PIXCLK = Clock(PIXCLK, 100, "image sensor at 10 MHz")
_DCLK = Clock(DCLK, 770.8, "37 cycles (fitted) of the microcontroller's 48 MHz")
_ENABLE = Clock(ENABLE, 1000, "microcontroller, a few times per second; latches BANK")
_ALE = Clock(ALE, 83, "bus accesses of four cycles at 48 MHz")

#: Recorded area of the designs: output of ``cubestack hdl area --ice40 --fmax --json``.
AREA_FILE = Path(__file__).parent / "area.json"

TOPS: TopTable = {
    "cubestar": Top(CubeStarTop, "CubeStar frame buffer", (_PIXCLK, _DCLK, _ENABLE)),
    "cubestar-shared": Top(
        CubeStarShared, "CubeStar, one SRAM for FPGA and processor", (_PIXCLK, _ALE, _ENABLE)
    ),
    "cubestar-double": Top(
        CubeStarDouble,
        "CubeStar, two SRAMs in turn",
        (_PIXCLK, _ALE, Clock(RNW, 1000, "microcontroller, a few times per second; latches INTO")),
    ),
    "cubestar-boards": Top(
        CubeStarTwoBoards,
        "CubeStar, model of two shared-memory boards on one bus",
        (_PIXCLK, _ALE, *(_ENABLE._replace(port=f"BOARD{n}_ENABLE") for n in (1, 2))),
        parts=2,
    ),
    "matrix counter 1024 x 512": Block(partial(MatrixCounter, 1024, 512)),
    "frame writer 1024 x 512": Block(partial(FrameWriter, 1024, 512)),
    "frame reader 1024 x 512": Block(partial(FrameReader, 1024, 512)),
}

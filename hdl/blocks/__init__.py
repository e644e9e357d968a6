"""Components that several FPGA designs share: counters, frame writer and reader, bus port."""

from cubestack.hdl.blocks.bus_port import BusPort
from cubestack.hdl.blocks.frame_gap import FrameGap
from cubestack.hdl.blocks.frame_reader import FrameReader
from cubestack.hdl.blocks.frame_writer import FrameWriter
from cubestack.hdl.blocks.gray_counter import GrayCounter
from cubestack.hdl.blocks.matrix_counter import MatrixCounter
from cubestack.hdl.blocks.pinned import PinnedComponent
from cubestack.hdl.blocks.stride import Stride

__all__ = [
    "BusPort",
    "FrameGap",
    "FrameReader",
    "FrameWriter",
    "GrayCounter",
    "MatrixCounter",
    "PinnedComponent",
    "Stride",
]

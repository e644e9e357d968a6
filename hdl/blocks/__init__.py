"""Components that several FPGA designs share: counters, frame writer and reader, bus port."""

from cubestack.hdl.blocks.bus_port import BusPort
from cubestack.hdl.blocks.counters import GrayCounter, MatrixCounter
from cubestack.hdl.blocks.frames import FrameGap, FrameReader, FrameWriter
from cubestack.hdl.blocks.pinned import PinnedComponent, RtlilComponent, Stride

__all__ = [
    "BusPort",
    "FrameGap",
    "FrameReader",
    "FrameWriter",
    "GrayCounter",
    "MatrixCounter",
    "PinnedComponent",
    "RtlilComponent",
    "Stride",
]

"""All designs by name: the tops with their pins and clocks, and the blocks worth a comparison."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

from amaranth.hdl import Shape
from amaranth.lib.wiring import Component, Out

from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE
from cubestack.firmware_model.interface.cubesense.fpga_registers import ADDRESSES, GROUP_ADDRESS
from cubestack.hdl.blocks.frame_gap import FrameGap
from cubestack.hdl.blocks.frame_reader import FrameReader
from cubestack.hdl.blocks.frame_writer import FrameWriter
from cubestack.hdl.blocks.gray_counter import GrayCounter
from cubestack.hdl.blocks.i2c_target import I2cTarget
from cubestack.hdl.blocks.matrix_counter import MatrixCounter
from cubestack.hdl.cubesense import top as cubesense_top
from cubestack.hdl.cubesense.dataflow import Side
from cubestack.hdl.cubesense.i2c import top as cubesense_i2c_top
from cubestack.hdl.cubesense.i2c.pair import CubeSenseI2cPair
from cubestack.hdl.cubesense.i2c.pointer import MemoryPointer
from cubestack.hdl.cubesense.i2c.registers import CubeSenseI2cRegisters
from cubestack.hdl.cubesense.i2c.top import CubeSenseI2cFpga
from cubestack.hdl.cubesense.nadir_scan import NadirScan
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubesense.reader import CubeSenseReader
from cubestack.hdl.cubesense.sun_search import SunSearch
from cubestack.hdl.cubesense.sun_window import SunWindow
from cubestack.hdl.cubesense.top import CubeSenseFpga
from cubestack.hdl.cubestar import double_top as cubestar_double_top
from cubestack.hdl.cubestar import shared_top as cubestar_shared_top
from cubestack.hdl.cubestar import top as cubestar_top
from cubestack.hdl.cubestar.double_top import CubeStarDouble
from cubestack.hdl.cubestar.shared_top import CubeStarShared
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.cubestar.two_boards import CubeStarTwoBoards

__all__ = ["BLOCKS", "TOPS", "Clock", "Pin", "Top", "pins_of"]


class Clock(NamedTuple):
    """An input that clocks flip-flops; shortest period in ns."""

    port: str
    period_ns: float
    source: str


class Pin(NamedTuple):
    """A pin, or a bus of them, as the package has it: at most three ports are one pin.

    ``direction`` is "input", "output", "tristate" (an output that can be off) or "inout".
    """

    name: str
    width: int
    direction: str
    level_in: str | None
    level_out: str | None
    enable: str | None
    enable_width: int
    meaning: str


@dataclass(frozen=True)
class Top:
    """A design of whole FPGAs.

    Attributes:
        make: its component, at full size.
        summary: what it is, in one line.
        clocks: inputs that clock flip-flops, unrelated to each other.
        meanings: of its ports.
        parts: AGLN030s that it fills; more than one for a model of several chips.
        pulled_up: pins that need a pull-up.
        reset: what makes the registers' state.
    """

    make: Callable[[], Component]
    summary: str
    clocks: tuple[Clock, ...]
    meanings: dict[str, str]
    parts: int = 1
    pulled_up: tuple[str, ...] = ()
    reset: str = "standby"


_SRAM = {
    "SRAM_A": "SRAM address",
    **dict.fromkeys(("SRAM_D_I", "SRAM_D_O", "SRAM_D_OE"), "SRAM data"),
    "SRAM_CE_N": "SRAM chip enable, low active",
    "SRAM_OE_N": "SRAM output enable, low active",
    "SRAM_WE_N": "SRAM write enable, low active",
}
_CUBESTAR = _SRAM | {pin.port: f"{pin.meaning} (header {pin.pins})" for pin in cubestar_top.PINS}
_SHARED = _SRAM | cubestar_shared_top.PINS
_DOUBLE = cubestar_double_top.PINS | {
    f"SRAM{n}_{name.removeprefix('SRAM_')}": f"{meaning}, memory {n - 1}"
    for n in (1, 2)
    for name, meaning in _SRAM.items()
}
_BOARDS = _SHARED | {
    **{f"BOARD{n}_{port}": f"board {n}: {text}" for n in (1, 2) for port, text in _SHARED.items()},
    "CONTENTION": "model only: both boards drive the bus",
}
_CUBESENSE = {
    port: pins.meaning
    for pins in (*cubesense_top.PINS, cubesense_top.ADDRESSING_PINS)
    for port in pins.ports
} | {"LINK_C_OE": cubesense_top.PINS[-1].meaning}
_PAIR = {
    **{
        f"{prefix}_{port}": f"{side}: {meaning}"
        for prefix, side in (("SUN", "sun"), ("NAD", "nadir"))
        for port, meaning in _CUBESENSE.items()
    },
    **_CUBESENSE,
    **dict.fromkeys(("DATA", "DATA_OE"), "bytes to the microcontroller"),
    "SUNEN": "sun's enable, low active",
    "NADEN": "nadir's enable, low active",
    "SUNACK": "a whole picture is in the sun's memory",
    "NADACK": "a whole picture is in the nadir's memory",
    "CONTENTION": "model only: DATA, link data, link control lines 0 and 1 have two drivers",
}

_CUBESENSE_I2C = {port: pins.meaning for pins in cubesense_i2c_top.PINS for port in pins.ports}
_PAIR_I2C = {
    **{
        f"{prefix}_{port}": f"{side}: {meaning}"
        for prefix, side in (("SUN", "sun"), ("NAD", "nadir"))
        for port, meaning in _CUBESENSE_I2C.items()
    },
    **_CUBESENSE_I2C,
    "SDA_I": "model only: what all others make of SDA",
    "SDA": "I2C data with both FPGAs, open drain",
    "CONTENTION": "model only: link data, link control lines have two drivers",
}

_PIXCLK = Clock("PIXCLK", 100, "image sensor at 10 MHz")
_DCLK = Clock("DCLK", 770.8, "37 cycles of the microcontroller's 48 MHz")
_ENABLE = Clock("ENABLE", 1000, "microcontroller, a few times a second; latches BANK")
_ALE = Clock("ALE", 83, "bus accesses of four cycles at 48 MHz")
_PCLK = Clock("PCLK", 74, "OV7620 at 13.5 MHz")
_CLK = Clock("CLK", 400, "two instructions of the microcontroller at 5 MHz")
_LINK = Clock("LINK_C[0]", 74, "the other camera's PCLK, over the link")
_SCL = Clock("SCL", 1000, "I2C at 1 MHz, both edges")
_SDA = Clock("SDA", 1000, "I2C's START and STOP, both edges")


def _cubesense(side: Side, mcu_addressing: bool) -> Top:
    option = ", the microcontroller sets the address" if mcu_addressing else ""
    return Top(
        partial(CubeSenseFpga, side, FULL_SIZE, mcu_addressing),
        f"CubeSense, {side} sensor's FPGA{option}",
        (_PCLK, _LINK, _CLK),
        _CUBESENSE,
        pulled_up=("LINK_C",),
    )


def _pair(mcu_addressing: bool) -> Top:
    option = ", the microcontroller sets the address" if mcu_addressing else ""
    return Top(
        partial(CubeSensePair, FULL_SIZE, mcu_addressing),
        f"CubeSense, model of both FPGAs and their link{option}",
        (_PCLK._replace(port="SUN_PCLK"), _PCLK._replace(port="NAD_PCLK"), _CLK),
        _PAIR,
        parts=2,
    )


def _cubesense_i2c(side: Side) -> Top:
    return Top(
        partial(CubeSenseI2cFpga, side),
        f"CubeSense, {side} sensor's FPGA on an I2C bus",
        (_PCLK, _LINK, _SCL, _SDA),
        _CUBESENSE_I2C,
        pulled_up=("SCL", "SDA", "LINK_C"),
        reset="RESET_N low",
    )


#: Tops by the name that the command line uses.
TOPS = {
    "cubestar": Top(CubeStarTop, "CubeStar frame buffer", (_PIXCLK, _DCLK, _ENABLE), _CUBESTAR),
    "cubestar-shared": Top(
        CubeStarShared,
        "CubeStar, one SRAM for FPGA and processor",
        (_PIXCLK, _ALE, _ENABLE),
        _SHARED,
    ),
    "cubestar-double": Top(
        CubeStarDouble,
        "CubeStar, two SRAMs in turn",
        (_PIXCLK, _ALE, _ENABLE._replace(port="RNW", source=_ENABLE.source[:-4] + "INTO")),
        _DOUBLE,
    ),
    "cubestar-boards": Top(
        CubeStarTwoBoards,
        "CubeStar, model of two shared-memory boards on one bus",
        (_PIXCLK, _ALE, *(_ENABLE._replace(port=f"BOARD{n}_ENABLE") for n in (1, 2))),
        _BOARDS,
        parts=2,
    ),
    "cubesense-sun": _cubesense("sun", mcu_addressing=False),
    "cubesense-nadir": _cubesense("nadir", mcu_addressing=False),
    "cubesense-sun-addressing": _cubesense("sun", mcu_addressing=True),
    "cubesense-nadir-addressing": _cubesense("nadir", mcu_addressing=True),
    "cubesense-pair": _pair(mcu_addressing=False),
    "cubesense-pair-addressing": _pair(mcu_addressing=True),
    "cubesense-sun-i2c": _cubesense_i2c("sun"),
    "cubesense-nadir-i2c": _cubesense_i2c("nadir"),
    "cubesense-pair-i2c": Top(
        CubeSenseI2cPair,
        "CubeSense, model of both FPGAs, their link and their I2C bus",
        (_PCLK._replace(port="SUN_PCLK"), _PCLK._replace(port="NAD_PCLK"), _SCL),
        _PAIR_I2C,
        parts=2,
        reset="RESET_N low",
    ),
}

#: Blocks by name, at full size.
BLOCKS: dict[str, Callable[[], Component]] = {
    "matrix counter 640 x 480": partial(MatrixCounter, 640, 480),
    "Gray counter of 307200": partial(GrayCounter, 640 * 480),
    "matrix counter 1024 x 512": partial(MatrixCounter, 1024, 512),
    "frame writer 1024 x 512": partial(FrameWriter, 1024, 512),
    "frame reader 1024 x 512": partial(FrameReader, 1024, 512),
    "frame writer 640 x 480": partial(FrameWriter, 640, 480),
    "frame gap of 858 clocks": partial(FrameGap, 858),
    "nadir scan": partial(NadirScan, FULL_SIZE),
    "Sun search": partial(SunSearch, FULL_SIZE),
    "Sun window": partial(SunWindow, FULL_SIZE),
    "CubeSense reader": partial(CubeSenseReader, FULL_SIZE),
    "the same, addressing": partial(CubeSenseReader, FULL_SIZE, mcu_addressing=True),
    "I2C target": partial(I2cTarget, ADDRESSES["sun"], GROUP_ADDRESS),
    "memory pointer": partial(MemoryPointer, FULL_SIZE),
    "I2C registers with these two": partial(CubeSenseI2cRegisters, "sun", FULL_SIZE),
}


def pins_of(component: Component, meanings: dict[str, str]) -> list[Pin]:
    """Pins of a top: ports NAME_I, NAME_O (or NAME) and NAME_OE are one."""
    members = component.signature.members
    pins = []
    for port, member in members.items():
        name = port.removesuffix("_OE").removesuffix("_I")
        if name != port and f"{name}_OE" in members:
            continue  # a side of another port's pin
        name = port.removesuffix("_O")
        enable = f"{name}_OE" if f"{name}_OE" in members else None
        level_in = f"{name}_I" if enable and f"{name}_I" in members else None
        if enable:
            direction = "inout" if level_in else "tristate"
        else:
            direction = "output" if member.flow is Out else "input"
        pins.append(
            Pin(
                name if enable else port,
                Shape.cast(member.shape).width,
                direction,
                port if direction == "input" else level_in,
                None if direction == "input" else port,
                enable,
                Shape.cast(members[enable].shape).width if enable else 0,
                meanings[port],
            )
        )
    return pins

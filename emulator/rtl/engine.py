"""What an engine is: the FPGA with its SRAM, run in virtual time by camera and microcontroller.

Two engines keep to it. The compiled one is quick; the one on the Amaranth simulator is the
reference, and the fallback where there is no C++ compiler.
"""

import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.sram import SramTiming, Violation, ViolationKind
from cubestack.hdl.cubestar_top import CubeStarTop

__all__ = [
    "CAMERA_PINS",
    "MCU_PINS",
    "OUTPUT_PINS",
    "PinEvent",
    "PixelSource",
    "RtlEngine",
    "StreamSegment",
    "make_engine",
]

#: Inputs that the camera drives. DCLK and PIXCLK are clocks, and so is ENABLE, for BANK only.
CAMERA_PINS = ("PIXCLK", "PIXDATA", "HSYNC", "VSYNC")
#: Inputs that the microcontroller drives.
MCU_PINS = ("ENABLE", "RNW", "BANK", "DCLK")
#: Outputs to the microcontroller, then those to the SRAM.
OUTPUT_PINS = (
    "ACK",
    "DATA",
    "SRAM_A",
    "SRAM_D_O",
    "SRAM_D_OE",
    "SRAM_CE_N",
    "SRAM_OE_N",
    "SRAM_WE_N",
)


class StreamSegment(Protocol):
    """A stretch of the camera's output with an unbroken pixel clock: blanking, or whole lines."""

    @property
    def start_ps(self) -> int:
        """First rising edge of PIXCLK; rising edge n is at floor(start_ps + n * period)."""

    @property
    def clocks(self) -> int:
        """Number of pixel clocks."""

    @property
    def vsync(self) -> int:
        """Level of VSYNC throughout."""

    @property
    def rows(self) -> int:
        """Number of lines; 0 is blanking, with HSYNC low throughout.

        Otherwise ``clocks`` is ``rows * line_clocks``, and HSYNC is high in the first
        ``active_columns`` clocks of each line.
        """

    @property
    def pixels(self) -> Callable[[], NDArray[np.uint8]] | None:
        """Renders the lines: shape (rows, active_columns), uint8, C-contiguous.

        Called only when the FPGA may store them, and once for each time the segment is given out.
        """


class PixelSource(Protocol):
    """The camera's parallel output. Data and syncs change with the falling edge of PIXCLK."""

    @property
    def period(self) -> Fraction:
        """Time of one PIXCLK in ps."""

    @property
    def line_clocks(self) -> int:
        """PIXCLKs of a line, those with HSYNC low included."""

    @property
    def active_columns(self) -> int:
        """PIXCLKs of a line with HSYNC high."""

    def segment_at(self, time_ps: int) -> StreamSegment | None:
        """Segment whose clocks contain ``time_ps``; None when there is no pixel clock then.

        After None the engine asks again only when told to, by ``stream_changed``.
        """


class PinEvent(NamedTuple):
    """One input pin takes a level."""

    time_ps: int
    pin: str
    level: int


class RtlEngine(Protocol):
    """The FPGA, cycle for cycle, and its SRAM.

    Time only moves in ``run``, ``apply`` and ``strobe_read``. At one instant, edges of the pixel
    clock come first, then what the caller does to the microcontroller's pins.
    """

    @property
    def sram(self) -> NDArray[np.uint8]:
        """The memory's bytes, a live view, shape (2 ** width of SRAM_A,)."""

    @property
    def now_ps(self) -> int:
        """Virtual time."""

    @property
    def violations(self) -> list[Violation]:
        """The first broken rules of each kind; see :mod:`cubestack.emulator.sram`."""

    @property
    def violation_counts(self) -> Counter[ViolationKind]:
        """How often each rule was broken."""

    def attach(self, source: PixelSource | None) -> None:
        """Connect a camera at ``now_ps``. None disconnects it: PIXCLK, syncs and data go low."""

    def stream_changed(self) -> None:
        """Ask the source again: what it does from ``now_ps`` on is not what it said before."""

    def set_pin(self, name: str, value: int) -> None:
        """Drive one of ``MCU_PINS`` from ``now_ps`` on; ValueError for any other pin."""

    def get_pin(self, name: str) -> int:
        """Settled level at ``now_ps`` of any input or output pin.

        Clocks that change nothing may have been skipped. The one trace that leaves is in SRAM_D_O
        while SRAM_D_OE is low.
        """

    def run(self, until_ps: int, stop_on: tuple[str, int] | None = None) -> int:
        """Advance to ``until_ps``, pixel clock edges at that very instant included.

        ``stop_on`` is ("ACK", level): stop right after the edge that brings ACK to that level, or
        at once when it is there already. Returns ``now_ps``; ValueError for a time in the past.
        """

    def strobe_read(self, out: NDArray[np.uint8], period: Fraction, until_ps: int) -> int:
        """Run the microcontroller's transfer loop from ``now_ps``.

        In each cycle of ``period`` ps, DCLK rises, DATA is taken into ``out`` after half the
        period, and DCLK falls. Only cycles that end by ``until_ps`` are made. Returns how many, n;
        ``now_ps`` advances by floor(n * period). The fraction cut off there is kept for a burst
        of the same period that follows at once, so that bursts do not drift.
        """

    def apply(self, events: Sequence[PinEvent]) -> NDArray[np.int64]:
        """Drive any input pin at any time, for tests of one engine against another.

        Events are in the order of time, none before ``now_ps``, and no two clock edges at one
        instant. PIXCLK and the camera's other pins can be driven only while no source is
        attached. Returns the settled levels after each event, shape (events, OUTPUT_PINS).
        """

    def close(self) -> None:
        """Release what the engine holds; it can not be used afterwards."""


def make_engine(
    top: CubeStarTop | None = None,
    kind: Literal["auto", "compiled", "python"] = "auto",
    sram_timing: SramTiming | None = None,
    *,
    skipping: bool = True,
) -> RtlEngine:
    """Make an engine for ``top``, which is the full-size board unless given.

    Args:
        top: the design.
        kind: "compiled", "python" (the Amaranth simulator), or "auto": compiled where there is a
            C++ compiler, else the simulator with a warning.
        sram_timing: limits that the SRAM model checks.
        skipping: skip pixel clocks that provably change nothing.

    Raises:
        CompilerError: "compiled" without a C++ compiler, or the compiler failed.
    """
    # Here because the engines import this module for the contract above.
    from cubestack.emulator.rtl.build import NoCompilerError
    from cubestack.emulator.rtl.compiled import CompiledEngine
    from cubestack.emulator.rtl.simulated import SimulatedEngine

    if top is None:
        top = CubeStarTop()
    if kind == "python":
        return SimulatedEngine(top, sram_timing, skipping=skipping)
    try:
        return CompiledEngine(top, sram_timing, skipping=skipping)
    except NoCompilerError as error:
        if kind == "compiled":
            raise
        warnings.warn(
            f"{error}; using the Amaranth simulator, about a thousand times slower", stacklevel=2
        )
        return SimulatedEngine(top, sram_timing, skipping=skipping)

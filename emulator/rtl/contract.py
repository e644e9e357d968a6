"""What an engine is: FPGAs and their SRAMs, run in virtual time by cameras and microcontroller.

Two engines keep to it. The compiled one is quick; the one on the Amaranth simulator is the
reference, and the fallback where there is no C++ compiler.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.sram import Violation, ViolationKind
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.emulator.sim.fpga_port import FpgaPort


class PixelSegment(Protocol):
    """A stretch of the camera's output with an unbroken pixel clock: blanking, or whole lines."""

    @property
    def start_ps(self) -> int:
        """First rising edge of the clock; rising edge n is at floor(start_ps + n * period)."""

    @property
    def clocks(self) -> int:
        """Number of pixel clocks."""

    @property
    def vsync(self) -> int:
        """Level of the frame pin throughout, where there is one."""

    @property
    def rows(self) -> int:
        """Number of lines; 0 is blanking, with the line pin low throughout.

        Otherwise ``clocks`` is ``rows * line_clocks``, and the line pin is high in the first
        ``active_columns`` clocks of each line.
        """

    @property
    def pixels(self) -> Callable[[], NDArray[np.uint8]] | None:
        """Renders the lines: shape (rows, active_columns), uint8, C-contiguous.

        Called only when the FPGA may store them, and once for each time the segment is given out.
        """


class PixelSource(Protocol):
    """The camera's parallel output. All but the clock change with its falling edge."""

    @property
    def period(self) -> Fraction:
        """Time of one pixel clock in ps."""

    @property
    def line_clocks(self) -> int:
        """Clocks of a line, those with the line pin low included."""

    @property
    def active_columns(self) -> int:
        """Clocks of a line with the line pin high."""

    def segment_at(self, time_ps: int) -> PixelSegment | None:
        """Segment whose clocks contain ``time_ps``; None when there is no pixel clock then.

        After None the engine asks again only when told to, by ``stream_changed``.
        """


class PinEvent(NamedTuple):
    """One input pin takes a level."""

    time_ps: int
    pin: str
    level: int


class RtlEngine(FpgaPort, Protocol):
    """A wiring's design, cycle for cycle, and its SRAMs.

    Time only moves in ``run``, ``apply``, ``strobe_read`` and ``access``. At one instant, edges of
    the first camera's pixel clock come first, then those of the next one's, then what the caller
    does to the microcontroller's pins.
    """

    @property
    def wiring(self) -> Wiring:
        """Names of all pins, cameras and memories."""

    @property
    def memories(self) -> dict[str, NDArray[np.uint8]]:
        """Each memory's bytes by its name, live views, shape (2 ** width of its address,)."""

    @property
    def sram(self) -> NDArray[np.uint8]:
        """Bytes of the first memory."""

    @property
    def violations(self) -> list[Violation]:
        """The first broken rules of each kind; see :mod:`cubestack.emulator.rtl.sram`."""

    @property
    def violation_counts(self) -> Counter[ViolationKind]:
        """How often each rule was broken."""

    def attach(self, source: PixelSource | None, camera: str | None = None) -> None:
        """Connect a camera at ``now_ps``, by default the first one.

        None disconnects it: clock, syncs and data go low.
        """

    def stream_changed(self, camera: str | None = None) -> None:
        """Ask the source again: what it does from ``now_ps`` on is not what it said before."""

    def power_memory(self, name: str, on: bool) -> None:
        """Switch a memory's supply at ``now_ps``; all memories begin with it.

        Without supply it ignores writes, answers reads with 0 and breaks no rules. Its bytes stay
        in ``memories``: what is left of them is the caller's to say.
        """

    @property
    def registers(self) -> dict[str, int]:
        """Bits of every register by its path in the design; empty in the simulated engine."""

    def flip(self, register: str, bit: int) -> None:
        """Turn over a bit of a register at ``now_ps``, as a particle does; ValueError for none.

        A register that is in reset at once has its reset value again.
        """

    def apply(self, events: Sequence[PinEvent]) -> NDArray[np.int64]:
        """Drive any input pin at any time, for tests of one engine against another.

        Events are in the order of time, none before ``now_ps``, and no two clock edges at one
        instant. A camera's pins can be driven only while no source is attached to it. Returns the
        settled levels of the wiring's ``output_pins`` after each event, shape (events, pins).
        """

    def close(self) -> None:
        """Release what the engine holds; it can not be used afterwards."""

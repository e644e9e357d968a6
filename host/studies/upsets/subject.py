"""The subject of upsets: a device's loop, its verdict, and what its processor sees of its FPGAs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.emulator.sim.fpga_port import Driver, FpgaPort, Transactions

Answer = Literal["right", "refused", "wrong"]

IDLE = "idle"
"""State of idle FPGAs."""

STORING = "storing"
"""State of storing FPGAs; between two images it is the phase `BETWEEN`."""

BETWEEN = "between"


@dataclass(frozen=True)
class UpsetVerdict:
    """What the device answered after a loop, beside the truth; ``reason`` of a refusal."""

    answer: Answer
    reason: str = ""


@dataclass(frozen=True)
class Subject:
    """How one device is put to work."""

    scene: Callable[[np.random.Generator], Any]  #: something that it should measure rightly
    start: Callable[[Any], None]  #: has a powered-up one begin a loop, and returns at once
    judge: Callable[[Any], UpsetVerdict]  #: waits for the answer of its loop, and judges it
    #: what the FPGAs are commanded: `IDLE`, `STORING`, or another name
    state: Callable[[RtlEngine], str]
    row_bytes: int  #: of a line of the picture
    period_s: float = 1.0  #: from one loop to the next, in use
    #: waits until a device that was just powered up takes commands
    ready: Callable[[Any], None] = lambda _emulated: None


@dataclass(frozen=True)
class Rig:
    """Whose bits are turned over, and in what work."""

    subjects: tuple[Subject, ...]  #: how it is put to work; one of them by chance
    #: of its FPGAs, for the names of their registers; the same object for the same ones
    wiring: Callable[[], Wiring]
    phases: tuple[str, ...]  #: of a loop, those that there always are
    memories: tuple[str, ...]  #: of the board, by name, that are hit by default
    board: Mapping[str, Any] = field(default_factory=dict)  #: keywords that choose it


class PortWatch:
    """An ``FpgaPort`` that stands where the processor looks for its FPGA, and keeps what passes.

    Attributes:
        data: all bytes that were read, in their order.
        seen: times in ps, pins and levels at which acknowledges were looked at and had changed.
    """

    def __init__(self, engine: FpgaPort, acknowledges: tuple[str, ...]) -> None:
        self._engine = engine
        self._levels = dict.fromkeys(acknowledges, 0)
        self.data = bytearray()
        self.seen: list[tuple[int, str, int]] = []

    def clear(self) -> None:
        self.data, self.seen = bytearray(), []

    @property
    def now_ps(self) -> int:
        return self._engine.now_ps

    @property
    def running(self) -> int:
        return self._engine.running

    @property
    def driver(self) -> Driver | None:
        return None

    def attend(self, reached_ps: int, end: int, camera: int, until_ps: int) -> int:
        return self._engine.attend(reached_ps, end, camera, until_ps)

    def set_pin(self, name: str, value: int) -> None:
        self._engine.set_pin(name, value)

    def get_pin(self, name: str) -> int:
        level = self._engine.get_pin(name)
        if self._levels.get(name, level) != level:
            self._levels[name] = level
            self.seen.append((self._engine.now_ps, name, level))
        return level

    def run(self, until_ps: int, stop_on: tuple[str, int] | None = None) -> int:
        return self._engine.run(until_ps, stop_on)

    def strobe_read(self, out: NDArray[np.uint8], period: Fraction, until_ps: int) -> int:
        done = self._engine.strobe_read(out, period, until_ps)
        self.data += out[:done].tobytes()
        return done

    def access(self, transactions: Transactions, until_ps: int) -> int:
        done = self._engine.access(transactions, until_ps)
        if not transactions.write:
            self.data += transactions.data[:done].tobytes()
        return done

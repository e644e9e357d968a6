"""What the processor sees of its FPGAs: bytes, and acknowledges with their times."""

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.sim.fpga_port import Driver, FpgaPort, Transactions


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

"""The program's clock: the part's timer behind its prescaler of 256.

CubeSense thesis, section 7.4: time = ticks x 256 / 5 MHz, so a tick is 51.2 us and 16 bits hold
3.4 s. Every published duration has these steps, and so have these.
"""

from cubestack.firmware_model.mcu.pic18 import INSTRUCTION_HZ
from cubestack.firmware_model.mcu.requests import ReadTimer, Routine

PRESCALER = 256

_CYCLES_PER_US = INSTRUCTION_HZ // 1_000_000
_MASK = 0xFFFF


def ticks_of(us: int) -> int:
    """Whole ticks in so many microseconds, not wrapped."""
    return us * _CYCLES_PER_US // PRESCALER


def microseconds(ticks: int) -> int:
    """Duration of so many ticks, rounded down."""
    return ticks * PRESCALER // _CYCLES_PER_US


def read_ticks() -> Routine[int]:
    """The timer's 16 bits."""
    now_us: int = yield ReadTimer()
    return ticks_of(now_us) & _MASK


def ticks_since(started: int) -> Routine[int]:
    """Ticks since the timer showed ``started``, right for up to 3.35 s."""
    now = yield from read_ticks()
    return now - started & _MASK

"""Bad firmware on the board: a report of one screen, and time continues."""

import numpy as np
import pytest

from cubestack.emulator.boards.cubestar.firmware import CubeStarFirmwareBoard
from cubestack.emulator.iss.image import Image
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_MS
from tests.emulator.iss.armv7m.thumb import Program

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")

SKY = SkyScene(np.array([0.0, 0.0, 0.0, 1.0]), mag_limit=3.8)
LINES_OF_A_SCREEN = 40

CCR, HFCORECLKEN0, WDOG_CTRL = 0xE000_ED14, 0x400C_8040, 0x4008_8000


def jump_into_nowhere(code: Program) -> None:
    code.load(0, 0x3000_0001)
    code.bx(0)


def stack_overflow(code: Program) -> None:
    code.label("again")
    code.push(0, 1, 2, 3, 4, 5, 6, 7, 14)
    code.b("again")


def divide_by_zero(code: Program) -> None:
    code.poke(CCR, 0x210, by=(0, 1))
    code.movs(2, 0)
    code.udiv(1, 1, 2)


def lock_up(code: Program) -> None:
    code.vector(3, 0x3000_0001)
    code.half(0xDE00)


def watchdog(code: Program) -> None:
    code.poke(HFCORECLKEN0, 0x1F, by=(0, 1))
    code.poke(WDOG_CTRL, 1, by=(0, 1))


def interrupts_off(code: Program) -> None:
    code.cps(False)


def reserved_registers(code: Program) -> None:
    code.load(0, 0x4000_0000)
    code.load(1, 0xFFFF_FFFF)
    code.load(2, 0x400E_0000)
    code.label("next")
    code.str(1, 0)
    code.adds(0, 4)
    code.half(0x4290)  # CMP r0, r2
    code.b("next", 1)


CASES = {
    jump_into_nowhere: ("HardFault", "instruction fetch from an unused address", "30000000"),
    stack_overflow: ("HardFault", "stack overflow?"),
    divide_by_zero: ("HardFault", "division by zero"),
    lock_up: ("lock-up", "undefined instruction"),
    watchdog: ("watchdog reset",),
    interrupts_off: (),
    reserved_registers: (),
}


@pytest.mark.parametrize("write", CASES, ids=lambda write: write.__name__)
def test_bad_firmware(write):
    code = Program()
    code.handler(3, 0x300)  # bare, as a start-up file has it
    code.forever()
    if write is reserved_registers:
        code.handler(3)  # goes on behind what faulted
        code.half(0x9806, 0x3002, 0x9006)  # the stacked PC, two bytes on
        code.bx()
    code.at = 0x400
    write(code)
    code.forever()
    board = CubeStarFirmwareBoard(SKY, Image(((0, code.finish()),)), seed=1)
    told: list[str] = []
    board.connect_console(told.append)
    try:
        board.kernel.advance_to(60 * PS_PER_MS)
    finally:
        board.close()
    text = "\n".join(told)
    for expected in CASES[write]:
        assert expected in text
    if not CASES[write]:
        assert not told
    assert text.count("\n") < LINES_OF_A_SCREEN
    assert max((len(line) for line in text.splitlines()), default=0) <= 120

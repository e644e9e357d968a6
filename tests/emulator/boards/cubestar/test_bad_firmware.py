import numpy as np
import pytest

from cubestack.emulator.boards.cubestar.firmware import CubeStarFirmwareBoard
from cubestack.emulator.iss.image import Image
from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_MS
from tests.emulator.iss.armv7m.thumb import Program, store

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")

SKY = SkyScene(np.array([0.0, 0.0, 0.0, 1.0]), mag_limit=3.8)
LINES_OF_A_SCREEN = 40

CCR, HFCORECLKEN0, WDOG_CTRL = 0xE000_ED14, 0x400C_8040, 0x4008_8000


START_UP = ".org 0x300; @3: b .; .org 0x400"  # a bare handler, as a start-up file has it
TRAP = f"{store(CCR, 0x210)}; movs r2, #0; udiv r1, r1, r2"
DOG = f"{store(HFCORECLKEN0, 0x1F)}; {store(WDOG_CTRL, 1)}"
# The handler continues after what faulted.
SKIP = ".org 0x300; @3: ldr r0, [sp, #24]; adds r0, #2; str r0, [sp, #24]; bx lr; .org 0x400"
EACH = "next: str r1, [r0]; adds r0, #4; .short 0x4290; bne next"  # CMP r0, r2
CASES = {
    # name: (program, what the report has)
    "jump into nowhere": (
        "ldr r0, =0x30000001; bx r0",
        "HardFault", "instruction fetch from an unused address", "30000000",
    ),
    "stack overflow": ("again: .short 0xB5FF; b again", "HardFault", "stack overflow?"),  # PUSH
    "divide by zero": (TRAP, "HardFault", "division by zero"),
    "lock-up": (
        ".org 12; .short 1, 0x3000; .org 0x400; udf #0",  # no memory at the handler
        "lock-up", "undefined instruction",
    ),
    "watchdog": (DOG, "watchdog reset"),
    "interrupts off": ("cpsid i",),
    "reserved registers": (
        f"{SKIP}; ldr r0, =0x40000000; ldr r1, =0xFFFFFFFF; ldr r2, =0x400E0000; {EACH}",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_faulty_firmware_is_diagnosed_in_a_few_lines(name):
    program, *report = CASES[name]
    image = bytes(Program(f"{START_UP}; {program}; b .").image)
    board = CubeStarFirmwareBoard(SKY, Image(((0, image),)), seed=1)
    told: list[str] = []
    board.connect_console(told.append)
    try:
        board.kernel.advance_to(60 * PS_PER_MS)
    finally:
        board.close()
    text = "\n".join(told)
    for expected in report:
        assert expected in text
    if not report:
        assert not told
    assert text.count("\n") < LINES_OF_A_SCREEN
    assert max((len(line) for line in text.splitlines()), default=0) <= 120

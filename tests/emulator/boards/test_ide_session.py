"""The actions of an IDE's session with gdb-multiarch as the client, in a table.

They run one after the other in one session, on a CubeStar whose FPGA stores pictures meanwhile, and
on the bare part.
"""

import re
import shutil
import signal
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path
from time import monotonic
from typing import NamedTuple

import numpy as np
import pytest

from cubestack.emulator.boards.cubestar.firmware import CubeStarFirmwareBoard
from cubestack.emulator.boards.debugging import open_debugger
from cubestack.emulator.boards.efm32gg.board import Efm32ggBoard
from cubestack.emulator.boards.own_firmware import OwnFirmwareBoard
from cubestack.emulator.iss.image import Image, load_image
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_MS
from tests.emulator.boards.cubestar.builds import PROGRAMS, build, needs_both_compilers

GDB = shutil.which("gdb-multiarch")
pytestmark = [*needs_both_compilers, pytest.mark.skipif(GDB is None, reason="needs gdb-multiarch")]

LIMIT_S = 120  #: Wall time of a session
AGAIN_S = 20  #: Wall-clock seconds until gdb gets a further Ctrl-C
PATIENCE_PS = 50 * PS_PER_MS  #: The program runs so long before it is interrupted with Ctrl-C


class Action(NamedTuple):
    name: str
    commands: str  #: separated by "; "; ``{}`` is the server's address
    answers: tuple[str, ...]  #: regular expressions, which the output contains in this order


def line_of(text: str) -> int:
    source = (PROGRAMS / "ide.c").read_text().splitlines()
    return next(number for number, line in enumerate(source, 1) if text in line)


LOOP, ENDED = line_of("again and again"), line_of("the loop has ended")
AT_MAIN = "monitor reset halt; maintenance flush register-cache; tbreak main; continue; "
TICK = (
    r"Hardware watchpoint",
    r"Old value = \d+",
    r"systick_handler \(\)",
    "<signal handler called>",
)
WROTE = (r"Hardware watchpoint \d+: total", "set_total")

ACTIONS = [
    Action(name, commands, answers)
    for name, commands, *answers in (
        ("load", "load", "Loading section .text", "Transfer rate"),
        ("verify", "compare-sections .text", "matched"),
        ("reset and halt",
         "monitor reset halt; maintenance flush register-cache; info registers pc",
         "<reset_handler"),
        ("restart to main", AT_MAIN + "info symbol $pc", r"main \(\)", "main"),
        ("breakpoint at a function", "break square; continue",
         r"Breakpoint \d+, square \(value=1\)"),
        ("breakpoint at a line", f"break ide.c:{ENDED}; continue", "sum_of_squares", "return sum"),
        ("breakpoint at an address", "break *square; continue", r"Breakpoint \d+, square"),
        ("hardware breakpoint", "hbreak sum_of_squares; continue", r"sum_of_squares \(count=4\)"),
        ("temporary breakpoint", "tbreak set_total; continue; info breakpoints",
         r"Temporary breakpoint \d+, set_total \(value=30\)", "No breakpoints or watchpoints"),
        ("temporary hardware breakpoint", "thbreak square; continue", r"square \(value="),
        ("condition", "break square if value == 3; continue; print value", "= 3"),
        ("ignore count", f"tbreak ide.c:{LOOP}; continue; break square; ignore $bpnum 2; continue; "
         "print value", "= 3"),
        ("disabled breakpoint", "break square; disable $bpnum; break set_total; continue",
         r"Breakpoint \d+, set_total"),
        ("enabled once", "break square; enable once $bpnum; continue; info breakpoints",
         "square", r"breakpoint +dis +n"),
        ("commands of a breakpoint",
         "break set_total; python gdb.breakpoints()[-1].commands = 'print value + 1'; continue",
         "= 31"),
        ("log point", f'tbreak ide.c:{LOOP}; continue; dprintf square,"at %d\\n",value; '
         "tbreak set_total; continue", "at 1", "at 2", "at 3", "at 4", "set_total"),
        ("breakpoints by pattern", "rbreak ^squar; continue", r"square \(value="),
        ("step one instruction", "tbreak *square; continue; stepi; x/i $pc", "=> 0x"),
        ("next instruction", f"tbreak ide.c:{LOOP}; continue; nexti 8; info symbol $pc", "main"),
        ("step into", f"tbreak ide.c:{LOOP}; continue; step", r"sum_of_squares \(count=4\)"),
        ("step over", f"tbreak ide.c:{LOOP}; continue; next", "take_pictures"),
        ("step out", "tbreak square; continue; finish", r"Value returned is \$\d+ = \d+"),
        ("until", f"tbreak sum_of_squares; continue; until {ENDED}", "return sum"),
        ("advance", f"tbreak ide.c:{LOOP}; continue; advance square", r"square \(value=1\)"),
        ("skip a function", "skip function sum_of_squares; "
         f"tbreak ide.c:{LOOP}; continue; step; skip delete", r"set_total \(value=30\)"),
        ("return early", "tbreak square; continue; return (int)7; backtrace 1",
         "#0 .* sum_of_squares"),
        ("jump", f"tbreak set_total; continue; tbreak sum_of_squares; jump ide.c:{LOOP}",
         r"sum_of_squares \(count=4\)"),
        ("call a function", "print square(9)", "= 81"),
        ("backtrace", "tbreak square; continue; backtrace", r"#0 .*square", r"#1 .*sum_of_squares",
         r"#2 .*main"),
        ("frames and locals", "tbreak square if value == 2; continue; up; info locals; info args",
         "i = 2", "sum = 1", "count = 4"),
        ("watch", f"tbreak ide.c:{LOOP}; continue; set var total = 0; watch total; continue",
         *WROTE),
        ("watch with a condition",
         "set var total = 1; watch total if total == 30; continue; print total", *WROTE, "= 30"),
        ("watch a location", "set var total = 0; watch -l total; continue",
         "Hardware watchpoint", "set_total"),
        ("watch reads", "rwatch writes; continue", "Hardware read watchpoint", "set_total"),
        ("watch accesses", "awatch total; continue", "Hardware access", "set_total"),
        ("watch an interrupt", "watch ticks; continue; backtrace", *TICK),
        ("registers", "info registers",
         "r0 ", "sp ", "lr ", "pc ", "xpsr ", "primask ", "control "),
        ("set a register", "set $r5 = 0x1234; print/x $r5", "= 0x1234"),
        ("read memory", "x/2xw 0", "0x0 <vectors>:", "0x2001"),
        ("write memory", "set var place.y = 77; print place; output/x *(int *)&place.y",
         r"\{x = \d+, y = 77\}", "0x4d"),
        ("dump and restore", "dump binary memory {folder}/flash 0 0x40; "
         "restore {folder}/flash binary 0x20008000; print *(int *)0x20008000 == *(int *)0", "= 1"),
        ("search memory", "set var total = 0x5EA4C4; find /w &ticks, &total + 1, 0x5EA4C4",
         "<total>"),
        ("display", "display total; tbreak set_total; continue; undisplay 1", r"1: total = \d+"),
        ("printf", 'printf "%d and %d\\n", square(2), square(3)', "4 and 9"),
        ("types and source", "ptype place; list square; info line square",
         "int x", "value \\* value",
         r"Line \d+ of"),
        ("disassembly", "disassemble /s square", "Dump of assembler code", "mul", r"bx\s"),
        ("memory map", "info mem", "flash", "rw"),
        ("threads without an RTOS", "info threads", r"\* 1 +Thread 1"),
        ("interrupt", "continue; info symbol $pc", "received signal SIGINT", "section .text"),
        ("monitor", "monitor reg pc; monitor mww 0x20008000 0x1234; monitor mdw 0x20008000; "
         "monitor time; monitor regs CMU.STATUS",
         "pc +0x", "00001234", " s, core cycle", "CMU.STATUS"),
        ("monitor halt", "monitor halt", "halted at"),
        ("detach, attach", "detach; target remote {}; info symbol $pc",
         "detached", "section .text"),
        ("disconnect, connect", "set var place.x = 8; disconnect; target remote {}; "
         "print place.x", "= 8"),
        ("run again",
         "disconnect; target extended-remote {}; set remote exec-file x; tbreak main; run",
         r"breakpoint \d+, main \(\)"),
        ("reverse", "reverse-step", "does not support"),
    )
]  # fmt: skip
FPGA = Action(
    "FPGA at work",
    f"tbreak ide.c:{LOOP}; continue; monitor pins; x/4xb 0xC0000000",
    ("main", "ENABLE 0x1", "0xc0000000:"),
)
SKY = SkyScene(np.array([0.0, 0.0, 0.0, 1.0]), mag_limit=3.0)


def test_matrix_has_40_actions() -> None:
    assert len(ACTIONS) >= 40


@pytest.fixture(scope="module")
def image(tmp_path_factory: pytest.TempPathFactory) -> Image:
    return load_image(build("ide", tmp_path_factory.mktemp("ide"), "-O0"))


@pytest.fixture(params=[pytest.param("fpga", marks=pytest.mark.slow), "part"])
def board(image: Image, request: pytest.FixtureRequest) -> Iterator[OwnFirmwareBoard]:
    fpga = request.param == "fpga"
    made = CubeStarFirmwareBoard(SKY, image, seed=3) if fpga else Efm32ggBoard(image, seed=3)
    yield made
    made.close()


def session(board: OwnFirmwareBoard, folder: Path, more: tuple[Action, ...]) -> dict[str, str]:
    """What GDB prints for each action. A program that runs too long is interrupted."""
    endpoint = open_debugger(board, 0)
    board.on_close.append(endpoint.close)
    lines = [
        "set confirm off",
        "set pagination off",
        "set width 0",
        f"target remote {endpoint.name}",
    ]
    for action in (*ACTIONS, *more):
        commands = action.commands.replace("{}", endpoint.name).replace("{folder}", str(folder))
        lines += [f"echo \\n@@{action.name}\\n", *commands.split("; "), "delete"]
    words = [word for line in (*lines, "detach") for word in ("-ex", line)]
    program = subprocess.Popen(
        [GDB or "", "-nx", "-batch", str(board.image.path), *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    said: list[str] = []
    reader = threading.Thread(target=lambda: said.extend(program.stdout or ()))
    reader.start()
    resumed_ps: int | None = None
    again_s = 0.0
    while reader.is_alive():
        if board.kernel.paused or not endpoint.connected:
            resumed_ps = None
            endpoint.serve(0.02)
            continue
        if resumed_ps is None:
            resumed_ps = board.kernel.now
        # A second Ctrl-C soon after the first would disconnect gdb.
        ready = board.kernel.now > resumed_ps + PATIENCE_PS and monotonic() > again_s
        if ready and "@@interrupt\n" in said[-3:]:
            program.send_signal(signal.SIGINT)
            again_s = monotonic() + AGAIN_S
        board.kernel.step()
    program.wait(LIMIT_S)
    assert program.stdout is not None
    program.stdout.close()
    parts = re.split(r"^@@(.*)$", "".join(said), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


@pytest.mark.slow
def test_every_action_of_a_session_has_its_effect(board: OwnFirmwareBoard, tmp_path: Path) -> None:
    more = (FPGA,) if isinstance(board, CubeStarFirmwareBoard) else ()
    said = session(board, tmp_path, more)
    wrong = []
    for name, _, answers in (*ACTIONS, *more):
        output = said.get(name, "(not reached)")
        if not re.search(".*?".join(answers), output, re.DOTALL):
            wrong.append(f"{name}: {answers}\n{output}")
    assert not wrong, "\n".join(wrong)

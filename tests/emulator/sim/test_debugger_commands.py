"""``monitor`` commands as IDEs and scripts for OpenOCD, pyOCD and J-Link send them."""

import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.sim.debugger import Debugger
from cubestack.emulator.sim.virtual_time import Kernel

from ..iss.efm32gg.bench import LOOP, MS, Bench

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")

CODE, RAM = 0x100, 0x2000_0000
MOVS_R1_5, UNDEFINED = 0x2105, 0xDE00
SEMIHOSTING_CALL = 0xBEAB


@pytest.fixture
def debugger() -> Debugger:
    """Attached to a program that sets R1 and loops."""
    bench = Bench(MOVS_R1_5, LOOP)
    found = Debugger(
        Kernel(), bench.machine, bench.machine.reset, (), command=lambda words: f"board {words}"
    )
    found.attach()
    return found


def run(debugger: Debugger) -> None:
    debugger.run(debugger.machine.now_ps + MS)


def test_program_is_halted_and_resumed(debugger: Debugger) -> None:
    debugger.monitor("resume")
    assert debugger.halted is None
    run(debugger)
    assert debugger.monitor("halt") == f"halted at {CODE + 2:#010x}"
    assert debugger.halted is not None


@pytest.mark.parametrize("command", ["reset", "reset halt", "reset init", "jtag_reset"])
def test_reset_halts_at_the_first_instruction(debugger: Debugger, command: str) -> None:
    debugger.resume()
    run(debugger)
    debugger.monitor(command)
    assert debugger.halted is not None
    assert debugger.register("pc") == CODE


def test_reset_run_lets_the_program_run(debugger: Debugger) -> None:
    debugger.monitor("reset run")
    assert debugger.halted is None
    run(debugger)
    assert debugger.register("r1") == 5


def test_memory_and_registers_are_shown_and_changed(debugger: Debugger) -> None:
    debugger.monitor(f"mww {RAM:#x} 0x12345678")
    debugger.monitor(f"mwh {RAM + 4:#x} 0xabcd")
    debugger.monitor(f"mwb {RAM + 6:#x} 0x1ff")
    assert debugger.monitor(f"mdw {RAM:#x} 2") == "0x20000000: 12345678 00ffabcd"
    assert debugger.monitor(f"mdh {RAM:#x}") == "0x20000000: 5678"
    assert debugger.monitor(f"mdb {RAM + 4:#x} 3") == "0x20000004: cd ab ff"
    assert len(debugger.monitor(f"mdb {RAM:#x} 40").splitlines()) == 3
    debugger.set_register("r3", 77)
    assert debugger.monitor("reg r3").split() == ["r3", "0x0000004d"]
    assert len(debugger.monitor("reg").splitlines()) == len(debugger.registers)


@pytest.mark.parametrize(
    ("command", "error"),
    [
        ("mdw 0x30000000", "nothing to read at 0x30000000"),
        ("mww 0x30000000 1", "nothing to write at 0x30000000"),
        ("mdw here", "'here' is not a number"),
        ("reg r99", "no register 'r99'; known: r0"),
        ("reset hard", "usage: reset"),
        ("arm semihosting maybe", "usage: semihosting"),
        ("cortex_m vector_catch everything", "no fault 'everything'; known: mm_err"),
    ],
)
def test_invalid_command_is_one_line(debugger: Debugger, command: str, error: str) -> None:
    with pytest.raises(ValueError, match="^" + error):
        debugger.monitor(command)


@pytest.mark.parametrize(
    "command",
    [
        "gdb_sync", "adapter speed 4000", "flash breakpoints = 1", "speed auto", "tpiu config off",
        "itm port 0 on", "init", "poll", "targets", "sleep 100", "clrbp", "cortex_m maskisr on",
        "semihosting IOClient 1",
    ],
)  # fmt: skip
def test_commands_of_a_probe_have_no_effect(debugger: Debugger, command: str) -> None:
    assert debugger.monitor(command) == ""


@pytest.mark.parametrize("command", ["catch on", "cortex_m vector_catch state_err hard_err"])
def test_faults_are_caught(debugger: Debugger, command: str) -> None:
    debugger.monitor(command)
    debugger.write(RAM, UNDEFINED.to_bytes(2, "little"))
    debugger.set_register("pc", RAM)
    debugger.resume()
    run(debugger)
    assert debugger.halted is not None
    assert debugger.register("xpsr") & 0x1FF == 3


@pytest.mark.parametrize("command", ["arm semihosting", "semihosting"])
def test_semihosting_is_switched(debugger: Debugger, command: str) -> None:
    debugger.write(RAM, SEMIHOSTING_CALL.to_bytes(2, "little"))
    for state, calls in (("enable", 1), ("disable", 0)):
        debugger.monitor(f"{command} {state}")
        debugger.set_register("pc", RAM)
        debugger.resume()
        run(debugger)
        assert len([one for one in debugger.machine.outbox() if one.kind == 8]) == calls
        debugger.machine.answer_call(0)


def test_other_commands_concern_the_board(debugger: Debugger) -> None:
    assert debugger.monitor("power off") == "board ['power', 'off']"
    assert debugger.monitor("help").endswith("board ['help']")

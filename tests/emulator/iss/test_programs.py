"""Programs with a start-up and a device header that were written without the emulator."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest

from cubestack.emulator.iss.image import load_image
from cubestack.emulator.iss.machine import Machine
from cubestack.emulator.iss.outcome import OutgoingKind, Stop, StopReason
from cubestack.emulator.sim.virtual_time import PS_PER_MS, PS_PER_US
from tests.emulator.iss.cross_compiler import compile_for_m3, needs_compiler
from tests.tiers import quick

PROGRAMS = Path(__file__).parent / "programs"
UART0 = 3
BYTE_PS = 10 * 10**12 // 115200

pytestmark = needs_compiler


class Bench:
    """A machine with a program, and the text from its UART."""

    def __init__(self, elf: Path) -> None:
        self.machine = Machine()
        self.machine.load(load_image(elf))
        self.machine.reset()
        self.text = ""
        self.times_ps: list[int] = []

    def run(self, until_ps: int) -> Stop:
        """Run, continuing after all stops except a lock-up."""
        while True:
            stop = self.machine.run(until_ps)
            for out in self.machine.outbox():
                if out.kind is OutgoingKind.UART and out.unit & 0xFF == UART0:
                    self.text += chr(out.value & 0xFF)
                    self.times_ps.append(out.time_ps)
                assert out.kind is not OutgoingKind.LOG, out.text  # the program makes no mistake
            if stop.now_ps >= until_ps or stop.reason is StopReason.LOCKED_UP:
                return stop

    def send(self, data: bytes) -> None:
        """Send characters at 115200 baud."""
        for byte in data:
            self.run(self.machine.now_ps + BYTE_PS)
            self.machine.uart_receive(UART0, byte)


Start = Callable[[str], Bench]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with all programs, each compiled for size and for speed."""
    folder = tmp_path_factory.mktemp("programs")
    for source in {*PROGRAMS.glob("*.c")} - {PROGRAMS / "startup.c"}:
        for option in ("-O0", "-Os", "-O2"):
            sources = PROGRAMS / "startup.c", source, "-T", PROGRAMS / "device.ld", "-lgcc"
            target = folder / f"{source.stem}{option}.elf"
            compile_for_m3(option, "-ffreestanding", "-nostdlib", *sources, "-o", target)
    return folder


@pytest.fixture(params=quick(["-O0", "-Os", "-O2"], 2))
def start(request: pytest.FixtureRequest, built: Path) -> Start:
    """Starts a program by name."""
    return lambda name: Bench(built / f"{name}{request.param}.elf")


def test_characters_received_by_dma_in_ping_pong_are_echoed(start: Start) -> None:
    bench = start("echo_dma")
    bench.run(5 * PS_PER_MS)
    assert bench.text == "ready\n"
    bench.send(b"quick brown fox jumps ov")
    bench.run(bench.machine.now_ps + 5 * PS_PER_MS)
    assert bench.text == "ready\nQUICK BROWN FOX JUMPS OV"


def test_low_energy_timers_wake_from_deep_sleep(start: Start) -> None:
    bench = start("low_energy")
    deepest = 0
    while bench.machine.now_ps < 2700 * PS_PER_MS:
        bench.run(bench.machine.now_ps + 37 * PS_PER_MS)
        deepest = max(deepest, bench.machine.energy_mode)
    assert deepest == 2
    assert bench.text in ("rtc 0000000a letimer 00000004\n", "rtc 0000000a letimer 00000005\n")
    # The crystal takes 1.4 s to start, with the reset value of its time-out; then ten times 0.1 s.
    assert bench.times_ps[0] / PS_PER_MS == pytest.approx(2400, abs=20)


def test_code_in_ram_keeps_a_boot_counter_in_flash(start: Start) -> None:
    bench = start("flash_log")
    bench.run(200 * PS_PER_MS)
    assert bench.text == "boot 00000001\nboot 00000002\nboot 00000003\n"
    words = bench.machine.flash[0xFF000 : 0xFF000 + 32].view("<u4")
    assert [int(word) for word in words] == [3 + i * 0x01010101 for i in range(8)]
    again = [time for time, c in zip(bench.times_ps, bench.text, strict=True) if c == "b"]
    assert min(b - a for a, b in pairwise(again)) > 20 * PS_PER_MS  # an erase


def test_fault_handlers_report_each_fault_and_continue(start: Start) -> None:
    bench = start("faults")
    bench.run(50 * PS_PER_MS)
    assert bench.text.splitlines() == [
        "UsageFault 02000000 00000000",
        "UsageFault 01000000 00000000",
        "UsageFault 00010000 00000000",
        "BusFault 00008200 00000000",
        "HardFault 00010000 40000000",
        "done",
    ]


def test_tasks_are_switched_by_systick_and_pendsv(start: Start) -> None:
    bench = start("rtos")
    bench.run(900 * PS_PER_MS)
    total = sum(n * n for n in range(1, 101))
    assert bench.text == f"sum {total:08x}\n"


def test_watchdog_resets_repeatedly(start: Start) -> None:
    bench = start("watchdog")
    bench.run(450 * PS_PER_MS)
    lines = bench.text.splitlines()
    assert len(lines) >= 3
    assert int(lines[0].split()[1], 16) & 1  # power-on
    assert set(lines[1:]) == {"cause 00000010"}


def test_i2c_slave_reads_and_writes_its_registers(start: Start) -> None:
    bench = start("i2c_slave")
    bench.run(5 * PS_PER_MS)
    machine = bench.machine

    def wait(answer: int | None) -> int:
        for _ in range(1000):
            if answer is not None:
                return answer
            bench.run(machine.now_ps + 5 * PS_PER_US)
            answer = machine.i2c_slave_poll(0)
        raise AssertionError("the clock stays stretched")

    def transfer(*data: int, read: int = 0) -> list[int]:
        acknowledged = [wait(machine.i2c_slave_start(0, 0x84))]
        for byte in data:
            bench.run(machine.now_ps + 90 * PS_PER_US)
            acknowledged.append(wait(machine.i2c_slave_write(0, byte)))
        assert all(acknowledged)
        found = []
        if read:
            bench.run(machine.now_ps + 100 * PS_PER_US)
            assert wait(machine.i2c_slave_start(0, 0x85))
            for _ in range(read):
                bench.run(machine.now_ps + 90 * PS_PER_US)
                found.append(wait(machine.i2c_slave_read(0)))
        bench.run(machine.now_ps + 10 * PS_PER_US)
        machine.i2c_slave_stop(0)
        bench.run(machine.now_ps + 100 * PS_PER_US)
        return found

    assert transfer(0, read=3) == [0xC0, 0xFF, 0xEE]
    transfer(5, 0x12, 0x34)
    assert transfer(5, read=2) == [0x12, 0x34]
    assert transfer(0, read=1) == [0xC0]
    assert not wait(machine.i2c_slave_start(0, 0x86))  # not its address

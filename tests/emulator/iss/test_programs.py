"""Programs with a start-up and a device header that were written without the emulator."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest

from cubestack.emulator.iss.outcome import Outgoing, OutgoingKind
from tests.emulator.iss.cross_compiler import binary_of, compile_for_m3, needs_compiler
from tests.tiers import quick_ones

from .efm32gg.bench import MS, US, Bench

PROGRAMS = Path(__file__).parent / "programs"
UART0 = 3
BYTE_PS = 10 * 10**12 // 115200

pytestmark = needs_compiler


class Console(Bench):
    """A part with a program, and the characters of its UART."""

    @property
    def sent(self) -> list[Outgoing]:
        assert self.log() == ""  # the program makes no mistake
        uart = [one for one in self.items if one.kind is OutgoingKind.UART]
        return [one for one in uart if one.unit & 0xFF == UART0]

    @property
    def text(self) -> str:
        return "".join(chr(one.value & 0xFF) for one in self.sent)

    def send(self, data: bytes) -> None:
        """Send characters at 115200 baud."""
        for byte in data:
            self.run_for(BYTE_PS)
            self.machine.uart_receive(UART0, byte)


Start = Callable[[str], Console]


@pytest.fixture(params=quick_ones(["-O0", "-Os", "-O2"], "-O2"))
def start(request: pytest.FixtureRequest, tmp_path: Path) -> Start:
    """Compiles a program by its name, and starts it."""

    def call(name: str) -> Console:
        sources = (PROGRAMS / file for file in ("startup.c", f"{name}.c"))
        options = request.param, "-ffreestanding", "-nostdlib", "-T", PROGRAMS / "device.ld"
        target = tmp_path / f"{name}.elf"
        compile_for_m3(*options, *sources, "-lgcc", "-o", target)
        return Console(image=binary_of(target))

    return call


def test_characters_received_by_dma_in_ping_pong_are_echoed(start: Start) -> None:
    bench = start("echo_dma")
    bench.run_until(5 * MS)
    assert bench.text == "ready\n"
    bench.send(b"quick brown fox jumps ov")
    bench.run_for(5 * MS)
    assert bench.text == "ready\nQUICK BROWN FOX JUMPS OV"


def test_low_energy_timers_wake_from_deep_sleep(start: Start) -> None:
    bench = start("low_energy")
    deepest = 0
    while bench.machine.now_ps < 2700 * MS:
        bench.run_for(37 * MS)
        deepest = max(deepest, bench.machine.energy_mode)
    assert deepest == 2
    assert bench.text in ("rtc 0000000a letimer 00000004\n", "rtc 0000000a letimer 00000005\n")
    # The crystal takes 1.4 s to start, with the reset value of its time-out; then ten times 0.1 s.
    assert bench.sent[0].time_ps / MS == pytest.approx(2400, abs=20)


def test_code_in_ram_keeps_a_boot_counter_in_flash(start: Start) -> None:
    bench = start("flash_log")
    bench.run_until(200 * MS)
    assert bench.text == "boot 00000001\nboot 00000002\nboot 00000003\n"
    words = bench.machine.flash[0xFF000 : 0xFF000 + 32].view("<u4")
    assert [int(word) for word in words] == [3 + i * 0x01010101 for i in range(8)]
    again = [one.time_ps for one in bench.sent if one.value == ord("b")]
    assert min(b - a for a, b in pairwise(again)) > 20 * MS  # an erase


def test_fault_handlers_report_each_fault_and_continue(start: Start) -> None:
    bench = start("faults")
    bench.run_until(50 * MS)
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
    bench.run_until(900 * MS)
    total = sum(n * n for n in range(1, 101))
    assert bench.text == f"sum {total:08x}\n"


@pytest.mark.parametrize(("name", "word"), [("tickless", "rtc"), ("tickless_burtc", "burtc")])
def test_tickless_kernel_sleeps_until_each_task_is_due(start: Start, name: str, word: str) -> None:
    bench = start(name)
    deepest = 0
    while bench.machine.now_ps < 2600 * MS:
        bench.run_for(13 * MS)
        deepest = max(deepest, bench.machine.energy_mode)
    assert deepest == 2
    counter, delay, slept = bench.text.split()
    assert (counter, slept) == (word, "slept")
    assert int(delay, 16) <= 20  # ticks of 30.5 us: the wake-up, and the other task
    # The crystal takes 1.4 s to start; the slow task ends after 8 times 2531 ticks.
    assert bench.sent[0].time_ps / MS == pytest.approx(1400 + 8 * 2531 / 32.768, abs=60)


def test_timer_starts_the_adc_through_the_prs(start: Start) -> None:
    bench = start("sampling")
    bench.machine.analog[0], bench.machine.analog[9] = 1.1, 3.3
    bench.machine.analog_changed()
    bench.run_until(60 * MS)
    _, value = bench.text.split()
    assert int(value, 16) == pytest.approx(4096 * 1.1 / 3.3, abs=2)
    first = next(one.time_ps for one in bench.sent[6:])
    assert (first - bench.sent[5].time_ps) / MS == pytest.approx(16, abs=0.3)


def test_watchdog_resets_repeatedly(start: Start) -> None:
    bench = start("watchdog")
    bench.run_until(450 * MS)
    lines = bench.text.splitlines()
    assert len(lines) >= 3
    assert int(lines[0].split()[1], 16) & 1  # power-on
    assert set(lines[1:]) == {"cause 00000010"}


def test_i2c_slave_reads_and_writes_its_registers(start: Start) -> None:
    bench = start("i2c_slave")
    bench.run_until(5 * MS)
    machine = bench.machine

    def wait(answer: int | None) -> int:
        for _ in range(1000):
            if answer is not None:
                return answer
            bench.run_for(5 * US)
            answer = machine.i2c_slave_poll(0)
        raise AssertionError("the clock stays stretched")

    def transfer(*data: int, read: int = 0) -> list[int]:
        acknowledged = [wait(machine.i2c_slave_start(0, 0x84))]
        for byte in data:
            bench.run_for(90 * US)
            acknowledged.append(wait(machine.i2c_slave_write(0, byte)))
        assert all(acknowledged)
        found = []
        if read:
            bench.run_for(100 * US)
            assert wait(machine.i2c_slave_start(0, 0x85))
            for _ in range(read):
                bench.run_for(90 * US)
                found.append(wait(machine.i2c_slave_read(0)))
        bench.run_for(10 * US)
        machine.i2c_slave_stop(0)
        bench.run_for(100 * US)
        return found

    assert transfer(0, read=3) == [0xC0, 0xFF, 0xEE]
    transfer(5, 0x12, 0x34)
    assert transfer(5, read=2) == [0x12, 0x34]
    assert transfer(0, read=1) == [0xC0]
    assert not wait(machine.i2c_slave_start(0, 0x86))  # not its address

from collections.abc import Callable
from typing import Any

import pytest

from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.faults.injection import Injection
from cubestack.emulator.faults.table import UartCorrupt, UartDelay, UartDrop
from cubestack.emulator.faults.wire import LineFaults
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel

BAUD = 10_000
BYTE_PS = 10**9
SENT = bytes(range(20))


class Line:
    """A UART with faults in its line; what arrives at either end, in byte times."""

    def __init__(self, seed: int = 1) -> None:
        self.kernel = Kernel()
        self.heard: list[tuple[float, int]] = []
        self.arrived: list[tuple[float, int]] = []
        self.log: list[str] = []
        self._seed = seed
        self.uart = Uart(self.kernel, BAUD, self._hear, lambda: None, silence_bytes=1000)
        self.uart.line = self._deliver
        self.faults = LineFaults(self.kernel, self._report, self.uart)

    def inject(self, fault: Any, start: float = 0, end: float | None = None) -> Injection:
        end_ps = None if end is None else round(end * BYTE_PS)
        number = len(self.faults.injections)
        injection = Injection(number, fault, "uart", round(start * BYTE_PS), end_ps, self._seed)
        self.faults.prepare(injection)
        return injection

    def both(self) -> tuple[list[tuple[float, int]], list[tuple[float, int]]]:
        self.uart.send(SENT)
        self.uart.host_writes(SENT)
        self.kernel.advance_to(self.kernel.now + 100 * BYTE_PS)
        return self.heard, self.arrived

    def _hear(self, byte: int) -> None:
        self.heard.append((self.kernel.now / BYTE_PS, byte))

    def _deliver(self, data: bytes, first_ps: int, byte_ps: int) -> None:
        times = [(first_ps + index * byte_ps) / BYTE_PS for index in range(len(data))]
        self.arrived += zip(times, data, strict=True)

    def _report(self, _time_ps: int, _injection: Injection, text: str) -> None:
        self.log.append(text)


CLEAN = [(1.0 + index, byte) for index, byte in enumerate(SENT)]
Change = Callable[[tuple[float, int]], list[tuple[float, int]]]


@pytest.mark.parametrize(
    ("fault", "change"),
    [(UartDrop, lambda _clock: []), (UartCorrupt, lambda clock: [(clock[0], clock[1] ^ 0x21)])],
)
@pytest.mark.parametrize("direction", ["both", "to-device", "to-host"])
def test_bytes_that_begin_in_time_are_hit(fault: Any, change: Change, direction: str) -> None:
    line = Line()
    options = {"mask": 0x21} if fault is UartCorrupt else {}
    line.inject(fault(direction=direction, **options), 3, 6.5)
    hit = [
        new for clock in CLEAN for new in (change(clock) if 3 <= clock[0] - 1 < 6.5 else [clock])
    ]
    heard, arrived = line.both()
    assert heard == (CLEAN if direction == "to-host" else hit)
    assert arrived == (CLEAN if direction == "to-device" else hit)
    assert len(line.log) == 4 * (2 if direction == "both" else 1)


def test_bytes_after_a_delayed_one_are_delayed_too_and_delays_do_not_add_up() -> None:
    line = Line()
    line.inject(UartDelay(delay_ms=2.5), 3, 3.5)
    expected = [(time if time < 4 else max(time, byte + 3.5), byte) for time, byte in CLEAN]
    assert line.both() == (expected, expected)
    line = Line()
    line.inject(UartDelay(delay_ms=2.0))
    expected = [(time + 2, byte) for time, byte in CLEAN]
    assert line.both() == (expected, expected)


def test_inactive_fault_does_not_split_blocks() -> None:
    line = Line()
    blocks: list[bytes] = []
    line.uart.line = lambda data, _first_ps, _byte_ps: blocks.append(data)
    line.inject(UartDrop(), 100)
    line.uart.send(SENT)
    assert blocks == [SENT]


def test_fault_rate_is_a_share_of_bytes_and_repeats_with_the_seed() -> None:
    logs = []
    for seed in (1, 1, 2):
        line = Line(seed)
        line.inject(UartCorrupt(rate=0.25))
        for _ in range(50):
            line.both()
        logs.append(line.log)
    assert logs[0] == logs[1] != logs[2]
    assert len(logs[0]) == pytest.approx(0.25 * 50 * 2 * len(SENT), rel=0.15)


def test_device_tap_sees_corrupted_bytes_like_the_device() -> None:
    line = Line()
    line.inject(UartCorrupt(mask=1, direction="to-device"))
    tapped: list[int] = []

    class Tap:
        def device_sent(self, data: bytes, first_ps: int, byte_ps: int) -> None: ...

        def device_heard(self, byte: int, start_ps: int) -> None:
            tapped.append(byte)

        def framing_error(self, time_ps: int) -> None: ...

    line.uart.taps.append(Tap())
    line.both()
    assert tapped == [byte ^ 1 for byte in SENT]


def test_byte_begun_under_a_fault_is_hit_despite_a_later_byte() -> None:
    line = Line()
    line.inject(UartDrop(direction="to-device"), 0, 0.5)
    line.uart.host_writes(b"a")
    line.kernel.advance_to(round(0.7 * BYTE_PS))
    line.inject(UartDrop(direction="to-host"), 50, 60)
    line.kernel.advance_to(2 * BYTE_PS)
    assert line.heard == []


def test_expired_faults_are_dropped() -> None:
    line = Line()
    for number in range(100):
        line.inject(UartDrop(), 250 * number, 250 * number + 0.5)  # in ms
        line.kernel.advance_to((number + 1) * PS_PER_S // 4)
    assert 4 <= len(line.faults.injections) <= 6

"""A processor on a fake FPGA and a fake camera bus, for tiny programs.

The clock is 1 MHz unless given, so a cycle is a microsecond.
"""

from collections.abc import Callable, Generator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.native import compiler
from cubestack.emulator.sim.processor import Processor
from cubestack.emulator.sim.virtual_time import PS_PER_US, Kernel
from cubestack.firmware_model.mcu.costs import Cost, CostTable, Meter
from cubestack.firmware_model.mcu.requests import CameraTransfer, Sleep

BOOT_US = 100
POWER_ON = 1
Body = Callable[["Desk"], Generator[Any, Any, None]]


class FakeEngine:
    """An FPGA whose ACK follows a list of (time, level), and whose DATA counts up.

    Like a real engine it refuses to run back, and drops cycles of the transfer loop that do not
    end in time.
    """

    def __init__(self) -> None:
        self.now_ps = 0
        self.ack: list[tuple[int, int]] = []
        self.pins: list[tuple[int, str, int]] = []
        self.bursts: list[tuple[int, int]] = []
        self._bytes_read = 0
        self._carry: tuple[int, Fraction] | None = None

    def _ack_at(self, time_ps: int) -> int:
        return ([0] + [level for time, level in self.ack if time <= time_ps])[-1]

    def run(self, until_ps: int, stop_on: tuple[str, int] | None = None) -> int:
        assert until_ps >= self.now_ps, "the engine can not run back"
        start, end = self.now_ps, until_ps
        if stop_on is not None:
            times = [start] + [time for time, _ in self.ack if start < time <= until_ps]
            end = next((time for time in times if self._ack_at(time) == stop_on[1]), until_ps)
        self.now_ps = end
        self.bursts.append((start, end))
        return end

    def set_pin(self, name: str, value: int) -> None:
        self.pins.append((self.now_ps, name, value))

    def get_pin(self, name: str) -> int:
        assert name == "ACK"
        return self._ack_at(self.now_ps)

    def strobe_read(self, out: Any, period: Fraction, until_ps: int) -> int:
        carry = Fraction(0)
        if self._carry is not None and self._carry[0] == self.now_ps:
            carry = self._carry[1]
        start, count = self.now_ps, 0
        while count < len(out) and start + int(carry + (count + 1) * period) <= until_ps:
            out[count] = self._bytes_read % 256
            self._bytes_read += 1
            count += 1
        whole, carry = divmod(carry + count * period, 1)
        self.now_ps = start + whole
        self._carry = (self.now_ps, carry)
        return count


class FakeCameraBus:
    """A camera that takes 50 us for a byte."""

    def transfer_ps(self, request: CameraTransfer) -> int:
        return (len(request.data) + request.read) * 50 * PS_PER_US

    def transfer(self, request: CameraTransfer, now_ps: int) -> bytes | None:
        return b"ok"


class FakePins:
    """One line that is not the FPGA's; it reads as the other level than it was driven to."""

    def __init__(self) -> None:
        self.driven = 0

    def __contains__(self, pin: object) -> bool:
        return pin == "LINE"

    def set_pin(self, pin: str, level: int) -> None:
        self.driven = level

    def get_pin(self, pin: str) -> int:
        return 1 - self.driven


@dataclass
class Program:
    """Runs the body it was given; the program of a later start sleeps for ever."""

    desk: "Desk"
    body: Body

    def main(self) -> Generator[Any, Any, None]:
        yield from self.body(self.desk)
        yield Sleep(None)


class Desk:
    """A processor, ready to run the bodies given: one a start, then one that sleeps.

    It has a clock of ``hz`` and costs of a test, unless a ``table`` of others is given.
    """

    def __init__(
        self, *bodies: Body, hz: int = 1_000_000, table: CostTable | None = None, engine: Any = None
    ) -> None:
        cycles = {"work": 1, "port_write": 2, "port_read": 3}
        costs = {name: Cost(number, "assumed", "a test") for name, number in cycles.items()}
        self.kernel = Kernel()
        self.meter = Meter(table or CostTable("test", hz, costs))
        self.engine = engine or FakeEngine()
        self.camera_bus = FakeCameraBus()
        self.causes: list[int] = []
        self.log: list[tuple[int, Any]] = []
        self.activity: list[tuple[int, bool]] = []
        self.pins_told: list[tuple[str, int]] = []
        self.accessing: list[bool] = []
        self._bodies = list(bodies)
        self.processor = Processor(
            self.kernel,
            self.meter,
            self.engine,
            self.camera_bus,
            self._boot,
            power_on_cause=POWER_ON,
            boot_us=BOOT_US,
            other_pins=FakePins(),
            on_pin=lambda pin, level: self.pins_told.append((pin, level)),
            on_activity=lambda busy: self.activity.append((self.us, busy)),
            on_access=self.accessing.append,
        )

    @property
    def us(self) -> int:
        """Time since the first start of main, in us."""
        return self.kernel.now // PS_PER_US - BOOT_US

    def _boot(self, cause: int) -> Program:
        self.causes.append(cause)
        return Program(self, self._bodies.pop(0) if self._bodies else lambda _desk: iter(()))

    def work(self, cycles: int) -> None:
        self.meter.charge(work=cycles)

    def note(self, what: object = None) -> None:
        self.log.append((self.us, what))

    def at(self, us: float, action: Callable[[], object]) -> None:
        delay = round((us + BOOT_US) * PS_PER_US) - self.kernel.now
        self.kernel.timeout(delay).callbacks.append(lambda _event: action())

    def ack_at(self, *us: int) -> None:
        times = [(time + BOOT_US) * PS_PER_US for time in us]
        self.engine.ack = [(time, 1 - index % 2) for index, time in enumerate(times)]

    def run(self, us: int = 1_000_000) -> "Desk":
        self.kernel.advance_to((us + BOOT_US) * PS_PER_US)
        return self


def script(*steps: object) -> Body:
    """A number is work, a function is called with the desk, a request's answer is noted."""

    def body(desk: Desk) -> Generator[Any, Any, None]:
        for step in steps:
            if isinstance(step, int):
                desk.work(step)
            elif callable(step):
                step(desk)
            else:
                desk.note((yield step))

    return body


@pytest.fixture
def desk_of() -> type[Desk]:
    """Makes a desk of the bodies to run."""
    return Desk


@pytest.fixture
def without_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No C++ compiler is found."""
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CXX", raising=False)
    monkeypatch.setattr(compiler.importlib.util, "find_spec", lambda name: None)


def make_compiler(folder: Path, name: str, on_compile: str, version: str = "1.0") -> Path:
    """A compiler that knows its version and, when it is to compile, runs ``on_compile``."""
    program = folder / name
    program.write_text(
        f'#!/bin/sh\ncase "$*" in *--version) echo {version}; exit 0;; esac\n{on_compile}\n'
    )
    program.chmod(0o755)
    return program

from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy as np

from cubestack.host.studies.upsets.watch import PortWatch


class Port:
    """An FPGA port whose levels and time are set by the test."""

    running = 2

    def __init__(self) -> None:
        self.now_ps = 100
        self.levels = {"ACK": 0, "DONE": 0, "other": 0}
        self.told = list[Any]()

    def get_pin(self, name: str) -> int:
        return self.levels[name]

    def set_pin(self, name: str, value: int) -> None:
        self.told.append((name, value))

    def run(self, until_ps: int, stop_on: tuple[str, int] | None) -> int:
        self.told.append((until_ps, stop_on))
        return until_ps - 1

    def attend(self, *of: int) -> int:
        self.told.append(of)
        return 7

    def strobe_read(self, out: Any, period: Fraction, until_ps: int) -> int:
        out[:3] = (1, 2, 3)
        return 3

    def access(self, transactions: Any, until_ps: int) -> int:
        return 2


def test_acknowledges_are_recorded_when_they_change() -> None:
    port: Any = Port()
    watch = PortWatch(port, ("ACK", "DONE"))
    for now_ps, name, level in (
        *((100, "ACK", 0), (200, "ACK", 1), (300, "ACK", 1), (350, "other", 1)),
        *((400, "DONE", 1), (500, "ACK", 0), (600, "DONE", 1)),
    ):
        port.now_ps, port.levels[name] = now_ps, level
        assert watch.get_pin(name) == level
    assert watch.seen == [(200, "ACK", 1), (400, "DONE", 1), (500, "ACK", 0)]
    watch.clear()
    assert (watch.seen, watch.data) == ([], bytearray())
    assert watch.get_pin("DONE") == 1
    assert watch.seen == []  # it is as it was


def test_received_bytes_are_kept() -> None:
    watch = PortWatch(Port(), ())  # type: ignore[arg-type]
    out = np.full(5, 9, np.uint8)
    assert watch.strobe_read(out, Fraction(1), 10) == 3
    data = np.array([4, 5, 6], np.uint8)
    read: Any = SimpleNamespace(write=False, data=data)
    written: Any = SimpleNamespace(write=True, data=data)
    assert watch.access(written, 10) == watch.access(read, 10) == 2
    assert bytes(watch.data) == bytes([1, 2, 3, 4, 5])


def test_other_calls_are_passed_on() -> None:
    port: Any = Port()
    watch = PortWatch(port, ("ACK",))
    watch.set_pin("READ", 1)
    assert watch.run(50, ("ACK", 1)) == 49
    assert watch.attend(1, 2, 3, 4) == 7
    assert port.told == [("READ", 1), (50, ("ACK", 1)), (1, 2, 3, 4)]
    assert (watch.now_ps, watch.running, watch.driver) == (100, 2, None)

"""Transactions on the external bus: their phases in exact times, and what is refused."""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from cubestack.emulator.sim.firmware_fpga import FpgaCoupling
from cubestack.emulator.sim.fpga_port import STEPS, TAKE, Transactions
from cubestack.firmware_model.mcu.external_bus import EBI, BusTiming

CYCLE = Fraction(10**12, 48_000_000)


def made(count: int = 3, **changes: Any) -> Transactions:
    given: dict[str, Any] = {
        "addresses": np.arange(count, dtype=np.int32),
        "data": np.zeros(count, np.uint8),
        "write": False,
        "cycle": CYCLE,
        "cycles": EBI.cycles + 2,
    }
    return Transactions(**given | changes)


def test_events_are_the_sums_of_the_phases() -> None:
    timing = BusTiming(2, 3, 1, 7, 2)
    one = made(timing=timing, cycles=40)
    # Latch opens, closes; select; strobe falls, rises; release.
    assert one.offsets == (0, 2, 5, 6, 13, 15)
    assert len(one.offsets) == STEPS
    assert one.offsets[TAKE] - one.offsets[TAKE - 1] == timing.strobe
    assert one.offsets[-1] == timing.cycles
    for event in range(3 * STEPS):
        index, step = event // STEPS, event % STEPS
        exact = (40 * index + one.offsets[step]) * CYCLE
        assert 0 <= exact - one.time_of(event) < 1
    assert one.period == 40 * CYCLE


def test_the_first_of_them_are_the_same_memory() -> None:
    whole = made(5)
    some = whole.first(2)
    assert (len(whole), len(some)) == (5, 2)
    assert some.addresses.tolist() == [0, 1]
    assert np.shares_memory(some.data, whole.data)
    assert (some.cycle, some.cycles, some.write) == (whole.cycle, whole.cycles, whole.write)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"addresses": np.arange(3)}, "transactions need contiguous int32"),
        ({"addresses": np.arange(6, dtype=np.int32)[::2]}, "transactions need contiguous int32"),
        ({"addresses": np.zeros((3, 1), np.int32)}, "transactions need contiguous int32"),
        ({"data": np.zeros(3, np.int8)}, "transactions need contiguous uint8"),
        ({"data": np.zeros(2, np.uint8)}, "3 addresses have 2 bytes: one each is needed"),
        ({"cycles": EBI.cycles - 1}, f"takes {EBI.cycles} cycles, not {EBI.cycles - 1}"),
    ],
)
def test_rejects_impossible_arguments(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        made(**changes)
    assert made(cycles=EBI.cycles).cycles == EBI.cycles


NOBODY = -1


class Memory:
    """An FPGA that is all memory: a byte at each address of each chip select."""

    driver = None
    running = 0

    def __init__(self) -> None:
        self.now_ps = 0
        self.bytes: dict[tuple[int, int], int] = {}

    def attend(self, *_burst: int) -> int:
        return 0

    def run(self, until_ps: int) -> int:
        self.now_ps = until_ps
        return until_ps

    def access(self, wanted: Transactions, until_ps: int) -> None:
        place = wanted.select, int(wanted.addresses[0])
        if wanted.write:
            self.bytes[place] = int(wanted.data[0])
        else:
            wanted.data[0] = self.bytes[place]


class Pins:
    hz = 48_000_000

    def couple(self, record: Any, _wires: Any) -> None:
        self.access = record.slow_external

    def stop(self) -> None: ...


def test_banks_lead_to_the_chip_selects_that_they_are_wired_to() -> None:
    fpga, machine = Memory(), Pins()
    coupling = FpgaCoupling(machine, fpga, (), banks=(2, 0))  # type: ignore[arg-type]
    machine.access(2, 0x100, 17, 1000)
    machine.access(0, 0x100, 34, 2000)
    assert fpga.bytes == {(0, 0x100): 17, (1, 0x100): 34}
    assert [machine.access(bank, 0x100, -1, 3000) for bank in (2, 0)] == [17, 34]
    assert [machine.access(bank, 0x100, -1, 4000) for bank in (1, 3)] == [NOBODY, NOBODY]
    coupling.after_run(5000)  # nothing was raised meanwhile

from typing import Any

from cubestack.emulator.sim.firmware_fpga import FpgaCoupling
from cubestack.emulator.sim.fpga_port import Transactions

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

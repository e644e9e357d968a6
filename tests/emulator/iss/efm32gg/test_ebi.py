"""External bus: banks, widths, cycles; the write buffer."""

import pytest

from .bench import Bench

BANK = 0x8000_0000
D8A8, D16A16ALE, D8A24ALE, D16 = range(4)
EBI_CYCLES_MAX = 3 + 63 + 3


def ebi(
    mode: int = D8A24ALE,
    *,
    address: int = 0x0000_0101,
    read: int = 0x0001_0201,
    write: int = 0x0001_0201,
    control: int = 0x1000,
) -> Bench:
    """Bank 0 with 1 kB of memory; timing is set-up 1, strobe 2, hold 1; no idle cycle."""
    bench = Bench(external_bytes=1024).clock("EBI")
    bench["EBI.ADDRTIMING"], bench["EBI.RDTIMING"] = address, read
    bench.load("EBI", WRTIMING=write, ROUTE=0x23 | 28 << 18, CTRL=mode | 0x100 | control)
    return bench


def cost(bench: Bench, size: int, *, write: bool = False, address: int = BANK) -> int:
    before = bench.machine.cycles
    if write:
        bench.machine.write(address, 0, size)
    else:
        bench.machine.read(address, size)
    return bench.machine.cycles - before


@pytest.mark.parametrize("mode", [D8A8, D16A16ALE, D8A24ALE, D16])
def test_ebi_memory_is_accessed_in_all_modes_and_sizes(mode: int) -> None:
    machine = ebi(mode).machine
    assert machine.write(BANK + 4, 0x1234_5678)
    assert machine.write(BANK + 8, 0xABCD, 2)
    assert machine.write(BANK + 11, 0xEF, 1)
    assert bytes(machine.external[4:12]) == bytes.fromhex("78563412cdab00ef")
    assert (machine.read(BANK + 4), machine.read(BANK + 6, 2)) == (0x1234_5678, 0x1234)
    assert machine.read(BANK + 11, 1) == 0xEF
    assert machine.read(0x1200_0004) == 0x1234_5678  # code space
    assert machine.peek(BANK + 4, 4) == bytes.fromhex("78563412")


@pytest.mark.parametrize(
    ("mode", "size", "cycles"),
    [
        # Set-up 1, strobe 2, hold 1; with a latched address 1 + 1 before that.
        (D8A8, 1, 4),
        (D8A8, 4, 16),
        (D8A24ALE, 1, 6),
        (D8A24ALE, 2, 12),
        (D16, 2, 4),
        (D16, 4, 8),
        (D16A16ALE, 2, 6),
        (D16A16ALE, 4, 12),
    ],
)
def test_ebi_read_takes_the_documented_cycles(mode: int, size: int, cycles: int) -> None:
    assert cost(ebi(mode), size) == cycles


def test_strobe_takes_at_least_one_cycle_and_an_idle_cycle_follows() -> None:
    bench = ebi(D8A24ALE, address=0, read=0)
    assert cost(bench, 1) == 1 + 1
    bench = ebi(D8A24ALE, address=0, read=0, control=0)
    assert cost(bench, 1) == 1 + 1 + 1


def test_write_buffer_holds_one_access() -> None:
    bench = ebi(D8A24ALE)
    assert cost(bench, 1, write=True) == 0
    assert bench.peek("EBI.STATUS") == 1
    assert cost(bench, 1, write=True) == 6  # the one before has to end
    assert cost(bench, 1) == 6 + 6
    bench = ebi(D8A24ALE, write=0x2001_0201)
    assert cost(bench, 1, write=True) == 6


def test_individual_timing_and_mode_of_a_bank() -> None:
    bench = ebi(D8A24ALE, control=0x4000_1200 | D16 << 2)
    bench["EBI.ROUTE"] |= 4
    assert bench["EBI.RDTIMING1"] == 0x0003_3F03
    assert bench.machine.read(BANK) is not None
    assert cost(bench, 4, address=0x8400_0000) == 2 * (EBI_CYCLES_MAX + 1)


def test_disabled_bank_is_a_bus_fault() -> None:
    bench = ebi()
    assert bench.machine.read(0x8400_0000) is None
    assert "bank 1" in bench.log()
    bench["EBI.CTRL"] = 0
    assert bench.machine.read(BANK) is None
    assert not bench.machine.write(BANK, 0)


def test_memory_is_not_accessed_without_pins() -> None:
    bench = ebi()
    bench["EBI.ROUTE"] = 0x3
    bench.machine.write(BANK, 0)
    assert bench.machine.external[0] == 0
    bench.machine.external[0] = 0x55
    assert bench.machine.read(BANK, 1) == 0xFF
    assert "without its pins" in bench.log()


def test_alternative_map_has_banks_of_256_mb() -> None:
    bench = ebi(control=0x8000_1000 | 0x200)
    bench["EBI.ROUTE"] |= 4
    bench.machine.write(0x8400_0000, 0x77, 1)  # still bank 0
    assert bench.machine.external[0] == 0x77
    assert bench.machine.read(0x9000_0000, 1) == 0xFF

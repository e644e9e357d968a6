import numpy as np
import pytest

from cubestack.emulator.faults import parts
from cubestack.emulator.faults.declaration import FaultError
from cubestack.emulator.faults.injection import Injection
from cubestack.emulator.faults.table import CoreFlip, CoreUpsets, MemoryUpsets
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel

BITS = 1 << 20


class Part:
    def __init__(self, rate: float, seed: int = 1) -> None:
        self.kernel = Kernel()
        self.memory = np.zeros(BITS // 8, np.uint8)
        self.log: list[tuple[int, str]] = []
        self.faults = parts.MemoryFaults(self.kernel, self._report, self.memory)
        self.injection = Injection(0, MemoryUpsets(rate=rate), "SRAM", 0, None, seed)
        self.faults.begin(self.injection)

    def _report(self, time_ps: int, _injection: Injection, text: str) -> None:
        self.log.append((time_ps, text))

    def run(self, seconds: float) -> int:
        self.kernel.advance_to(self.kernel.now + round(seconds * PS_PER_S))
        return int(np.unpackbits(self.memory).sum())


@pytest.mark.parametrize(
    "per_s", [100.0, 0.9 * parts.MOST_UPSETS_PER_S, 10 * parts.MOST_UPSETS_PER_S]
)
def test_upsets_follow_the_rate_everywhere(per_s: float) -> None:
    part = Part(per_s / BITS)
    found = part.run(2.0)
    odd = BITS / 2 * -np.expm1(-2 * 2 * per_s / BITS)  # turned over once, or three times, ...
    assert abs(found - odd) < 5 * np.sqrt(odd)
    half = int(np.unpackbits(part.memory[: BITS // 16]).sum())
    assert abs(half - found / 2) < 5 * np.sqrt(found) / 2
    planes = [int((part.memory >> bit & 1).sum()) for bit in range(8)]
    assert max(planes) - min(planes) < 10 * np.sqrt(found / 8)


def test_highest_rate_takes_a_bounded_number_of_steps() -> None:
    part = Part(1.0)
    assert part.run(0.1) == pytest.approx(BITS / 2 * -np.expm1(-0.2), rel=0.02)
    assert len(part.log) == round(0.1 / parts.BATCH_S) - 1
    assert sum(int(text.split()[0]) for _, text in part.log) == pytest.approx(0.1 * BITS, rel=0.02)


@pytest.mark.parametrize("per_s", [100.0, 10 * parts.MOST_UPSETS_PER_S])
def test_upsets_end_and_repeat_with_the_seed(per_s: float) -> None:
    parts = [Part(per_s / BITS, seed) for seed in (1, 1, 2)]
    counts = [part.run(0.5) for part in parts]
    assert parts[0].log == parts[1].log != parts[2].log
    np.testing.assert_array_equal(parts[0].memory, parts[1].memory)
    parts[0].faults.end(parts[0].injection)
    assert parts[0].run(1.0) == counts[0]


def test_flip_bit_inverts_one_bit() -> None:
    memory = np.zeros(4, np.uint8)
    parts.flip_bit(memory, 13)
    assert memory.tolist() == [0, 0x20, 0, 0]
    parts.flip_bit(memory, 13)
    assert not memory.any()


def test_flip_bits_applies_its_rate_per_bit_and_repeats_with_the_seed() -> None:
    first, again = np.zeros(200_000, np.uint8), np.zeros(200_000, np.uint8)
    count = parts.flip_bits(first, 1e-3, np.random.default_rng(1))
    assert count == int(np.unpackbits(first).sum()) == pytest.approx(1600, rel=0.1)
    assert parts.flip_bits(again, 1e-3, np.random.default_rng(1)) == count
    np.testing.assert_array_equal(first, again)
    memory = np.zeros(10, np.uint8)
    counts = [parts.flip_bits(memory, rate, np.random.default_rng(1)) for rate in (0.0, 1.0)]
    assert counts == [0, 80]
    assert (memory == 0xFF).all()


@pytest.mark.parametrize("rate", [-0.1, 1.1, float("nan")])
def test_rejects_invalid_probabilities(rate: float) -> None:
    with pytest.raises(ValueError, match="0 to 1 per bit"):
        parts.flip_bits(np.zeros(1, np.uint8), rate, np.random.default_rng(1))


class Core:
    def __init__(self) -> None:
        self.registers = {"r0": 32, "pc": 32, "primask": 1}
        self.flipped: list[tuple[str, int]] = []
        self.told: list[str] = []
        self.kernel = Kernel()
        self.faults = parts.CoreFaults(
            self.kernel, lambda _time, _of, text: self.told.append(text), self
        )

    def flip(self, register: str, bit: int) -> None:
        self.flipped.append((register, bit))

    def hit(self, fault: CoreFlip, seed: int = 1) -> None:
        injection = Injection(0, fault, "core", 0, None, seed)
        self.faults.prepare(injection)
        self.faults.begin(injection)


def test_core_flip_hits_the_named_register_bit() -> None:
    core = Core()
    core.hit(CoreFlip(register="pc", bit=20))
    core.hit(CoreFlip(register="primask", bit=20))  # which has only one
    assert core.flipped == [("pc", 20), ("primask", 0)]
    assert core.told == ["pc[20]", "primask[0]"]


def test_core_bit_is_drawn_from_all_registers() -> None:
    core, again = Core(), Core()
    for seed in range(100):
        core.hit(CoreFlip(), seed)
        again.hit(CoreFlip(), seed)
    assert core.flipped == again.flipped
    assert {name for name, _ in core.flipped} == set(core.registers)
    assert {bit for name, bit in core.flipped if name == "primask"} == {0}
    assert len({bit for _, bit in core.flipped}) > 20


def test_core_upsets_occur_at_the_rate_per_bit_until_the_fault_ends() -> None:
    core = Core()
    injection = Injection(0, CoreUpsets(rate=10.0), "core", 0, None, 1)
    core.faults.begin(injection)
    core.kernel.advance_to(PS_PER_S)
    expected = 10 * sum(core.registers.values())
    assert abs(len(core.flipped) - expected) < 5 * np.sqrt(expected)
    assert {name for name, _ in core.flipped} == set(core.registers)
    assert core.told == [f"{name}[{bit}]" for name, bit in core.flipped]
    core.faults.end(injection)
    core.kernel.advance_to(2 * PS_PER_S)
    assert len(core.flipped) == len(core.told)
    assert abs(len(core.flipped) - expected) < 5 * np.sqrt(expected)


def test_rejects_unknown_core_register_before_the_run() -> None:
    core = Core()
    injection = Injection(0, CoreFlip(register="r99"), "core", 0, None, 1)
    with pytest.raises(FaultError, match="no register 'r99', only r0, pc, primask"):
        core.faults.prepare(injection)
    assert core.flipped == []

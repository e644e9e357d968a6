"""The SRAM's rules, one at a time, at the limit and one picosecond beyond it."""

import ctypes
import logging
import subprocess
from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest

from cubestack.emulator.native import compiler
from cubestack.emulator.rtl import sram
from cubestack.emulator.rtl.sram import (
    MAX_VIOLATIONS,
    RULES,
    Sram,
    SramPins,
    SramTiming,
    Violation,
    ViolationLog,
)
from tests.tiers import quick

T = SramTiming()
START = 1_000_000


def make(*driven: tuple[int, SramPins]) -> Sram:
    sram = Sram(np.arange(64, dtype=np.uint8))
    for time_ps, pins in driven:
        sram.drive(time_ps, pins)
    return sram


def idle(address: int = 0, data: int | None = None) -> SramPins:
    return SramPins(address, ce_n=0, data=data)


def writing(address: int = 0, data: int | None = 0xA5) -> SramPins:
    return SramPins(address, ce_n=0, we_n=0, data=data)


def reading(address: int = 0, data: int | None = None) -> SramPins:
    return SramPins(address, ce_n=0, oe_n=0, data=data)


def found(sram: Sram) -> list[tuple[str, int, int]]:
    return [(v.kind, v.time_ps, v.address) for v in sram.violations.kept]


def test_write_takes_effect_at_the_end_of_the_pulse():
    sram = make((START, writing(5)), (START + T.write_pulse_ps - 1, writing(5)))
    assert sram.memory[5] == 5
    sram.drive(START + T.write_pulse_ps, idle(5))
    assert sram.memory[5] == 0xA5
    assert not found(sram)
    # Hold times are zero: changes at the end of the pulse come too late to be written.
    sram = make((START, writing(5, 0xA5)), (START + T.write_pulse_ps, idle(6, 0x11)))
    assert (sram.memory[5], sram.memory[6]) == (0xA5, 6)
    assert not found(sram)


@pytest.mark.parametrize("ends", [idle(5, 0xA5), SramPins(5, ce_n=1, we_n=0, data=0xA5)])
def test_short_write_pulse_is_a_violation(ends):
    sram = make((START, writing(5)))
    end = START + T.write_pulse_ps - 1
    sram.drive(end, ends)
    assert found(sram) == [("short-write-pulse", end, 5)]
    assert sram.violations.kept[0].detail == "write pulse of 7999 ps, at least 8000 ps needed"


def test_address_change_during_a_write_pulse_writes_both_addresses():
    sram = make((START, writing(5)), (START + 10_000, writing(6)), (START + 20_000, idle(6)))
    assert found(sram) == [("address-changed-during-write", START + 10_000, 5)]
    assert sram.memory[5] == sram.memory[6] == 0xA5


@pytest.mark.parametrize(("early", "broken"), [(6_000, False), (5_999, True)])
def test_data_setup_time_violation_is_reported(early, broken):
    sram = make(
        (START, writing(5, 0x11)),
        (START + 50_000 - early, writing(5, 0x22)),
        (START + 50_000, idle(5)),
    )
    assert found(sram) == [("data-setup", START + 50_000, 5)] * broken
    assert sram.memory[5] == 0x22


def test_writing_a_floating_bus_is_a_data_setup_violation():
    sram = make((START, writing(5, None)), (START + 50_000, idle(5)))
    assert found(sram) == [("data-setup", START + 50_000, 5)]


@pytest.mark.parametrize(
    ("before", "limit"),
    [(reading(4), 12_000), (SramPins(7, ce_n=1, oe_n=0), 12_000), (idle(7), 6_000)],
    ids=["address", "chip enable", "output enable"],
)
@pytest.mark.parametrize("late", [0, 1])
def test_memory_read_access_time_is_checked(before, limit, late):
    sram = make((0, before), (START, reading(7)))
    assert sram.sample(START + limit - late) == 7
    assert found(sram) == [("read-access", START + limit - 1, 7)] * late


def test_undriven_memory_has_no_access_limit():
    sram = make((START, idle(7, 0x33)))
    assert sram.sample(START) == 0x33
    sram.drive(START + 1, idle(8))
    assert sram.sample(START + 1) == 0
    assert not found(sram)


@pytest.mark.parametrize("first", [reading(7), idle(7, 0x33)])
def test_bus_contention_is_reported_once(first):
    sram = make((0, first), (START, reading(7, 0x33)), (START + 1, reading(8, 0x34)))
    assert found(sram) == [("bus-contention", START, 7)]


@pytest.mark.parametrize(("pause", "broken"), [(6_000, False), (5_999, True)])
def test_bus_turnaround_time_is_checked(pause, broken):
    sram = make((0, reading(7)), (START, idle(7)), (START + pause, idle(7, 0x33)))
    assert found(sram) == [("turnaround", START + pause, 7)] * broken


def test_memory_is_a_live_view():
    memory = np.zeros(16, np.uint8)
    sram = Sram(memory)
    memory[3] = 99
    sram.drive(START, reading(3))
    assert sram.bus == 99


def test_violations_are_all_counted_and_the_first_are_kept_and_logged(caplog):
    sram = make((0, reading(7)))
    with caplog.at_level(logging.WARNING):
        for _ in range(MAX_VIOLATIONS + 10):
            sram.sample(5)
    assert sram.violations.counts == {"read-access": MAX_VIOLATIONS + 10}
    assert len(sram.violations.kept) == MAX_VIOLATIONS
    assert [record.getMessage() for record in caplog.records] == [
        "SRAM read-access at 5 ps, address 0x00007: data used 5 ps after its cause, "
        "valid after 12000 ps"
    ]


def test_unpowered_memory_reads_0_and_reports_no_violation():
    sram = make((START, writing(5)))
    sram.power(False)
    for offset, pins in enumerate([writing(6), reading(6), writing(7, None), idle(7), reading(9)]):
        sram.drive(START + offset, pins)
        assert sram.sample(START + offset) == sram.bus == 0
    assert (sram.memory == np.arange(64)).all()
    assert not found(sram)
    sram.power(True)
    sram.drive(START + 10, reading(9))
    assert sram.sample(START + 10 + T.access_ps - 1) == 9
    assert found(sram) == [("read-access", START + 9 + T.access_ps, 9)]


def test_memories_may_share_a_log():
    log = ViolationLog()
    for name in ("sun", "nadir"):
        sram = Sram(np.zeros(4, np.uint8), violations=log, name=name)
        sram.drive(0, reading(3))
        sram.sample(5)
    assert [violation.where for violation in log.kept] == ["sun", "nadir"]
    assert log.counts == {"read-access": 2}


def test_every_memory_timing_rule_has_a_test():
    """The names of this file are those of the model, but for the engine's own."""
    alone = "short-write-pulse address-changed-during-write data-setup read-access bus-contention"
    assert set(RULES) - {"wire-contention"} == {*alone.split(), "turnaround"}


SIZE = 16
COMPILER = compiler.find_compiler()
TIMEOUT_S = 300


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> ctypes.CDLL:
    if COMPILER is None:
        pytest.skip("no C++ compiler")
    target = tmp_path_factory.mktemp("sram") / "sram.so"
    include = f"-I{Path(sram.__file__).parent / 'cxxrtl'}"
    source = Path(__file__).with_name("sram_harness.cpp")
    command = [*COMPILER.command, *compiler.FLAGS, include, str(source), "-o", str(target)]
    subprocess.run(command, check=True, timeout=TIMEOUT_S)
    library = ctypes.CDLL(str(target))
    long, flag = ctypes.c_int64, ctypes.c_bool
    library.sram_new.restype = ctypes.c_void_p
    library.sram_new.argtypes = [ctypes.c_void_p, ctypes.c_void_p, long]
    library.sram_delete.argtypes = [ctypes.c_void_p]
    library.sram_power.argtypes = [ctypes.c_void_p, flag]
    library.sram_drive.argtypes = [ctypes.c_void_p, long, ctypes.c_uint32, *[flag] * 4]
    library.sram_drive.argtypes += [ctypes.c_uint8]
    library.sram_sample.argtypes = [ctypes.c_void_p, long]
    library.sram_sample.restype = ctypes.c_uint8
    library.sram_kept.argtypes = library.sram_violations.argtypes = [ctypes.c_void_p]
    library.sram_kept.restype = long
    library.sram_violations.restype = ctypes.POINTER(long)
    library.sram_count.argtypes = [ctypes.c_void_p, ctypes.c_int32]
    library.sram_count.restype = long
    return library


def random_pins(rng: np.random.Generator, old: SramPins) -> SramPins:
    """One or several pins change, as registers and gates of one design let them."""
    levels = old._asdict()
    for name in rng.choice(list(levels), size=int(rng.integers(1, 4)), replace=False):
        match str(name):
            case "address":
                levels["address"] = int(rng.integers(0, SIZE))
            case "data":
                levels["data"] = None if rng.random() < 0.4 else int(rng.integers(0, 256))
            case control:
                levels[control] = int(rng.random() < 0.4)
    return SramPins(**levels)


@pytest.mark.parametrize("seed", quick(range(4), 1))
def test_compiled_memory_model_equals_the_python_model(library, seed):
    rng = np.random.default_rng(seed)
    timing = SramTiming(*(int(limit) for limit in rng.integers(1_000, 20_000, 5)))
    keep = 10**6
    memory = rng.integers(0, 256, SIZE, dtype=np.uint8)
    python = Sram(memory.copy(), timing)
    limits = (ctypes.c_int64 * 5)(*astuple(timing))
    other = library.sram_new(memory.ctypes.data, limits, keep)
    expected: list[Violation] = []
    python.violations.add = expected.append  # type: ignore[method-assign]  # unbounded
    pins, time_ps = SramPins(), 0
    for _ in range(8_000):
        time_ps += int(rng.choice([0, 1, *rng.integers(500, 30_000, 4)]))
        if rng.random() < 0.2:
            assert python.sample(time_ps) == library.sram_sample(other, time_ps)
            continue
        if rng.random() < 0.01:
            powered = bool(rng.random() < 0.7)
            python.power(powered)
            library.sram_power(other, powered)
        pins = random_pins(rng, pins)
        python.drive(time_ps, pins)
        driven = pins.data is not None
        library.sram_drive(other, time_ps, *pins[:4], driven, pins.data or 0)
        if rng.random() < 0.05:
            assert (python.memory == memory).all()
    kinds = list(RULES)
    raw = library.sram_violations(other)[: 6 * library.sram_kept(other)]
    rows = np.array(raw).reshape(-1, 6).tolist()
    assert [Violation(kinds[kind], *rest[:4]) for kind, *rest in rows] == expected
    for number, kind in enumerate(kinds):
        if kind == "wire-contention":  # no memory's
            continue
        count = sum(violation.kind == kind for violation in expected)
        assert count == library.sram_count(other, number)
        assert count > 5, kind
    library.sram_delete(other)

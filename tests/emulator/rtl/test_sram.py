"""The SRAM's rules, one at a time, at the limit and one picosecond beyond it."""

import logging

import numpy as np
import pytest

from cubestack.emulator.rtl.sram import (
    MAX_VIOLATIONS,
    RULES,
    Sram,
    SramPins,
    SramTiming,
    ViolationLog,
)

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


def test_hold_times_are_zero():
    """Changes at the end of the pulse come too late to be written."""
    sram = make((START, writing(5, 0xA5)), (START + T.write_pulse_ps, idle(6, 0x11)))
    assert sram.memory[5] == 0xA5
    assert sram.memory[6] == 6
    assert not found(sram)


@pytest.mark.parametrize("ends", [idle(5, 0xA5), SramPins(5, ce_n=1, we_n=0, data=0xA5)])
def test_short_write_pulse(ends):
    sram = make((START, writing(5)))
    end = START + T.write_pulse_ps - 1
    sram.drive(end, ends)
    assert found(sram) == [("short-write-pulse", end, 5)]
    assert sram.violations.kept[0].detail == "write pulse of 7999 ps, at least 8000 ps needed"


def test_address_moving_inside_a_pulse_writes_both():
    sram = make((START, writing(5)), (START + 10_000, writing(6)), (START + 20_000, idle(6)))
    assert found(sram) == [("address-changed-during-write", START + 10_000, 5)]
    assert sram.memory[5] == sram.memory[6] == 0xA5


@pytest.mark.parametrize(("early", "broken"), [(6_000, False), (5_999, True)])
def test_data_setup(early, broken):
    sram = make(
        (START, writing(5, 0x11)),
        (START + 50_000 - early, writing(5, 0x22)),
        (START + 50_000, idle(5)),
    )
    assert found(sram) == [("data-setup", START + 50_000, 5)] * broken
    assert sram.memory[5] == 0x22


def test_writing_a_floating_bus():
    sram = make((START, writing(5, None)), (START + 50_000, idle(5)))
    assert found(sram) == [("data-setup", START + 50_000, 5)]


@pytest.mark.parametrize(
    ("before", "limit"),
    [(reading(4), 12_000), (SramPins(7, ce_n=1, oe_n=0), 12_000), (idle(7), 6_000)],
    ids=["address", "chip enable", "output enable"],
)
@pytest.mark.parametrize("late", [0, 1])
def test_read_access(before, limit, late):
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
def test_turnaround(pause, broken):
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


def test_memory_without_supply_keeps_its_bytes_offers_0_and_breaks_no_rule():
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


def test_every_rule_can_be_broken_alone():
    """The names of this file are those of the model, but for the engine's own."""
    assert set(RULES) - {"wire-contention"} == {
        "short-write-pulse",
        "address-changed-during-write",
        "data-setup",
        "read-access",
        "bus-contention",
        "turnaround",
    }

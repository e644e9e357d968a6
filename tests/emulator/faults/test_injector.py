from typing import Any, cast

import pytest

from cubestack.emulator.boards.cubestar.layouts import CUBESTAR_POWER
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.faults import injector
from cubestack.emulator.faults.declaration import FaultError, Site
from cubestack.emulator.faults.injection import FaultEvent, Injection
from cubestack.emulator.faults.injector import Faults
from cubestack.emulator.faults.plan import Plan, PlannedFault
from cubestack.emulator.faults.sites import Sites
from cubestack.emulator.faults.table import UartDrop
from cubestack.emulator.sim.power import PowerModel
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel

BAUD = 10_000
BYTE_PS = 10**9
IDLE_MA = 71.2


class Desk:
    def __init__(self, seed: int = 3) -> None:
        self.kernel = Kernel()
        self.heard: list[int] = []
        self.uart = Uart(self.kernel, BAUD, self.heard.append, lambda: None, silence_bytes=1000)
        self.power = PowerModel(self.kernel, CUBESTAR_POWER)
        nobody = cast("Any", None)
        sites = Sites(self.kernel, nobody, {"uart": self.uart}, {}, self.power, None)
        self.faults = Faults(sites, seed)

    def to(self, seconds: float) -> None:
        self.kernel.advance_to(round(seconds * PS_PER_S))

    def say(self, data: bytes) -> bytes:
        del self.heard[:]
        self.uart.host_writes(data)
        self.kernel.advance_to(self.kernel.now + (len(data) + 2) * BYTE_PS)
        return bytes(self.heard)

    @property
    def deaf(self) -> bool:
        return self.say(b"x") == b""


@pytest.fixture
def desk() -> Desk:
    return Desk()


def test_fault_is_active_until_cleared(desk: Desk) -> None:
    injection = desk.faults.inject("uart-drop")
    assert (injection.number, injection.target, injection.start_ps) == (0, "uart", 0)
    assert (injection.end_ps, injection.seed) == (None, 3)
    assert desk.deaf
    desk.to(1)
    desk.faults.clear(injection)
    assert injection.end_ps == PS_PER_S
    assert not desk.deaf
    desk.faults.clear(injection)  # again does nothing
    assert injection.end_ps == PS_PER_S


def test_fault_is_active_for_its_duration(desk: Desk) -> None:
    first = desk.faults.inject(UartDrop(), at_s=1.0, for_s=0.5)
    second = desk.faults.inject(UartDrop(), at_s=2.0)
    assert [first.number, second.number] == [0, 1]
    assert (first.start_ps, first.end_ps) == (PS_PER_S, 15 * PS_PER_S // 10)
    assert not desk.deaf
    desk.to(1)
    assert desk.deaf
    desk.to(1.5)
    assert not desk.deaf
    desk.to(2)
    assert desk.deaf


def test_fault_cleared_before_its_start_has_no_effect(desk: Desk) -> None:
    desk.faults.inject(UartDrop(), at_s=1.0, for_s=1.0)
    kept = desk.faults.inject("latch-up", target="memory", at_s=1.0)
    desk.faults.clear(kept)
    desk.faults.clear()
    desk.to(1.1)
    assert not desk.deaf
    assert desk.power.current_ma() == pytest.approx(IDLE_MA)
    desk.to(3)
    assert desk.faults.events == 0


def test_clear_without_arguments_ends_all_faults(desk: Desk) -> None:
    both = [desk.faults.inject("uart-drop"), desk.faults.inject("uart-delay")]
    desk.to(0.25)
    desk.faults.clear()
    assert [one.end_ps for one in both] == [PS_PER_S // 4] * 2
    assert not desk.deaf


def test_latch_up_begins_at_its_time_and_clear_does_not_heal_it(desk: Desk) -> None:
    desk.faults.inject("latch-up", target="memory", at_s=0.5, extra_ma=11.0)
    desk.to(0.4999)
    assert desk.power.current_ma() == pytest.approx(IDLE_MA)
    desk.to(0.5 + 1e-12)
    assert desk.power.current_ma() == pytest.approx(IDLE_MA + 11.0)
    desk.faults.clear()  # it is over long since
    assert desk.power.current_ma() == pytest.approx(IDLE_MA + 11.0)


def test_accepts_times_at_the_limits(desk: Desk) -> None:
    desk.to(2)
    latest = desk.faults.inject("uart-drop", at_s=1e9, for_s=1e9)
    assert (latest.start_ps, latest.end_ps) == (10**21, 2 * 10**21)
    assert desk.faults.inject("uart-drop", at_s=2.0).start_ps == 2 * PS_PER_S
    assert desk.deaf
    shortest = desk.faults.inject("uart-drop", for_s=1e-15)
    assert shortest.end_ps == shortest.start_ps + 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"at_s": 1.999}, "uart-drop: at_s must be 2 to 1000000000 s, not 1.999"),
        ({"at_s": 1.1e9}, "uart-drop: at_s must be 2 to 1000000000 s, not 11"),
        ({"for_s": 0.0}, "uart-drop: for_s must be above 0 and at most 1000000000 s, not 0.0"),
        ({"target": "other"}, "uart-drop: unknown serial line 'other'; known: uart"),
    ],
)
def test_rejected_fault_leaves_no_trace(desk: Desk, arguments: dict[str, Any], words: str) -> None:
    desk.to(2)
    with pytest.raises(FaultError, match=words):
        desk.faults.inject("uart-drop", **arguments)
    assert not desk.deaf
    assert desk.faults.inject("uart-drop").number == 0


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda f: f.inject("latch-up", for_s=1.0), "happens at one instant; omit for_s"),
        (lambda f: f.inject("i2c-nack"), "i2c-nack: this device has no I2C bus to hit"),
        (lambda f: f.inject(UartDrop(), rate=0.5), "uart-drop already has parameters; omit rate"),
        (lambda f: f.load(plan("i2c-nack")), "p.toml: fault 1: i2c-nack: this device has no"),
        (lambda f: f.load(plan("uart-drop", "i2c-stuck")), "p.toml: fault 2: i2c-stuck: this"),
    ],
)
def test_rejects_faults_that_do_not_apply(desk: Desk, call: Any, words: str) -> None:
    with pytest.raises(FaultError, match=words):
        call(desk.faults)


def plan(*kinds: str) -> Plan:
    made = [injector.table.make_fault(kind) for kind in kinds]
    return Plan(9, tuple(PlannedFault(fault) for fault in made), "p.toml")


def test_plan_sets_the_seed(desk: Desk) -> None:
    loaded = desk.faults.load(plan("uart-drop", "latch-up"))
    assert [one.seed for one in loaded] == [9, 9] == [desk.faults.seed] * 2
    assert [one.number for one in loaded] == [0, 1]
    assert desk.deaf


def test_lists_fault_targets(desk: Desk) -> None:
    kinds = desk.faults.kinds()
    assert kinds["uart-drop"] == ("uart",)
    assert kinds["latch-up"] == ("memory", "imager")
    assert {name.split("-")[0] for name in kinds} == {"uart", "latch"}
    assert desk.faults.targets(Site.UART) == ("uart",)
    assert desk.faults.targets(Site.FPGA) == ()


def test_log_is_limited_but_counts_everything(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(injector, "LOG_LIMIT", 3)
    told: list[FaultEvent] = []
    desk.faults.on_event = told.append
    injection = desk.faults.inject("uart-drop")
    assert desk.say(b"abcde") == b""
    assert (injection.hits, desk.faults.events, len(told)) == (5, 5, 5)
    assert desk.faults.log == told[:3]
    assert (told[0].kind, told[0].target) == ("uart-drop", "uart")
    assert str(told[0]).startswith("0.000000000 s uart-drop uart: ")


def test_each_injection_has_its_own_random_numbers() -> None:
    def made(number: int = 0, seed: int = 5) -> Injection:
        return Injection(number, UartDrop(), "uart", 10, 20, seed)

    draws = [made().generator_at(4).random() for _ in range(2)]
    assert draws[0] == draws[1]
    others = {made(1).generator_at(4).random(), made(0, 6).generator_at(4).random()}
    assert len({draws[0], made().generator_at(5).random(), *others}) == 4
    one = made()
    assert [one.active(time_ps) for time_ps in (9, 10, 19, 20)] == [False, True, True, False]
    assert [one.draw(value, 7) for value in (0, 6, 7, 99)] == [0, 6, 6, 6]
    drawn = {one.draw(None, 7, key) for key in range(100)}
    assert drawn == set(range(7))
    assert one.has_effect(1.0)
    assert not any(one.has_effect(0.0) for _ in range(100))
    assert sum(one.has_effect(0.25) for _ in range(4000)) == pytest.approx(1000, abs=100)

"""Supplies: the published currents as sums of parts, charge, latch-up and its comparators."""

import pytest

from cubestack.emulator.boards.cubesense.board import CUBESENSE_POWER
from cubestack.emulator.boards.cubestar.layouts import CUBESTAR_POWER
from cubestack.emulator.sim.power import COMPARATOR_US, PowerModel
from cubestack.emulator.sim.virtual_time import PS_PER_MS, PS_PER_US, Kernel

TRIP_PS = COMPARATOR_US * PS_PER_US
PARTS, CHANNELS = CUBESTAR_POWER.parts, CUBESTAR_POWER.channels

# CubeStar thesis, table 6.2: current in mA, duration in ms, and what the parts do then.
MODES = {
    1: (71.2, 140, ("sleep", "disabled", "standby", "standby")),
    2: (121.2, 68, ("sleep", "enabled", "standby", "standby")),
    3: (177.3, 388, ("run", "enabled", "storing", "standby")),
    4: (81.81, 404, ("run", "disabled", "reading", "transfer")),
}


def enter(power: PowerModel, states: tuple[str, str, str, str]) -> None:
    for part, state in zip(("processor", "imager", "fpga", "memory"), states, strict=True):
        power.set_state(part, state)


@pytest.fixture
def kernel() -> Kernel:
    return Kernel()


@pytest.fixture
def power(kernel) -> PowerModel:
    return PowerModel(kernel, CUBESTAR_POWER)


@pytest.fixture
def tripped(kernel, power) -> list[tuple[int, str]]:
    found: list[tuple[int, str]] = []
    power.on_overcurrent = lambda channel: found.append((kernel.now, channel))
    return found


@pytest.mark.parametrize("mode", MODES)
def test_power_modes_draw_the_published_currents(power, mode):
    current_ma, _, states = MODES[mode]
    enter(power, states)
    assert power.current_ma() == pytest.approx(current_ma, abs=0.005)


def test_iteration_charge_matches_the_published_value(kernel, power):
    """Equation 6.3.1: 396.2 mW over one second at 3.3 V."""
    for _, duration_ms, states in MODES.values():
        enter(power, states)
        kernel.advance_to(kernel.now + duration_ms * PS_PER_MS)
    assert kernel.now == 1000 * PS_PER_MS
    assert power.charge_mas() * 3.3 == pytest.approx(396.2, abs=0.1)


def test_charge_integrates_the_current_before_and_after_switching(kernel, power):
    before = power.current_ma()
    kernel.advance_to(1000 * PS_PER_MS)
    power.switch("memory", False)
    after = power.current_ma()
    assert after < before
    kernel.advance_to(3000 * PS_PER_MS)
    assert power.charge_mas() == pytest.approx(before + 2 * after)


def test_total_current_is_the_sum_of_channels_and_unswitched_parts(power):
    enter(power, MODES[3][2])
    always_on = PARTS["leds"].ma["on"] + PARTS["processor"].ma["run"]
    channels = sum(power.current_ma(channel) for channel in CHANNELS)
    assert power.current_ma() == pytest.approx(channels + always_on)


def test_no_regular_state_trips_a_comparator(power):
    for channel, limit in CHANNELS.items():
        highest = sum(max(part.ma.values()) for part in PARTS.values() if part.channel == channel)
        assert limit is not None
        assert highest < limit


def test_switched_off_channel_draws_no_current(power):
    before = power.current_ma()
    imager = power.current_ma("imager")
    power.switch("imager", False)
    power.set_state("imager", "enabled")
    assert power.current_ma("imager") == 0
    assert power.current_ma() == pytest.approx(before - imager)
    power.switch("imager", True)
    assert power.current_ma("imager") == pytest.approx(imager + 50)


def test_power_switch_reports_changes_only(power):
    told = []
    power.on_switch = lambda *change: told.append(change)
    power.switch("memory", True)
    power.switch("memory", False)
    power.switch("memory", False)
    power.switch("memory", True)
    assert told == [("memory", False), ("memory", True)]


@pytest.mark.parametrize("channel", CHANNELS)
def test_latch_up_trips_its_comparator_once(kernel, power, tripped, channel):
    kernel.advance_to(5 * PS_PER_MS)
    before = power.current_ma(channel)
    power.latch_up(channel)
    assert power.current_ma(channel) == pytest.approx(before + 300)
    power.set_state("processor", "run")  # whatever changes meanwhile
    kernel.advance_to(100 * PS_PER_MS)
    power.set_state("processor", "sleep")
    kernel.advance_to(200 * PS_PER_MS)
    assert tripped == [(5 * PS_PER_MS + TRIP_PS, channel)]


@pytest.mark.parametrize("lasting", [False, True])
def test_lasting_latch_up_returns_after_switching_off(kernel, power, tripped, lasting):
    power.latch_up("memory", lasting=lasting)
    kernel.advance_to(PS_PER_MS)
    power.switch("memory", False)
    assert power.current_ma("memory") == 0
    power.switch("memory", True)
    assert power.current_ma("memory") == PARTS["memory"].ma["standby"] + 300 * lasting
    kernel.advance_to(2 * PS_PER_MS)
    if not lasting:
        power.latch_up("memory")  # and the comparator is ready for the next
    kernel.advance_to(3 * PS_PER_MS)
    again_ps = PS_PER_MS if lasting else 2 * PS_PER_MS
    assert tripped == [(TRIP_PS, "memory"), (again_ps + TRIP_PS, "memory")]


def test_current_shorter_than_the_comparator_delay_is_not_reported(kernel, power, tripped):
    power.latch_up("imager")
    kernel.advance_to(TRIP_PS - 1)
    power.switch("imager", False)
    kernel.advance_to(PS_PER_MS)
    assert tripped == []


def test_small_latch_up_is_not_detected_but_draws_charge(kernel, power, tripped):
    power.latch_up("memory", 20.0)
    kernel.advance_to(1000 * PS_PER_MS)
    assert tripped == []
    assert power.charge_mas() == pytest.approx(71.2 + 20.0, abs=0.005)


def test_comparator_trips_again_after_the_current_fell(kernel, power, tripped):
    """27.5 mA beside 2 or 3 mA: only a transfer brings the memory above its 30 mA."""
    power.latch_up("memory", 27.5)
    for state in ("transfer", "standby", "transfer"):
        power.set_state("memory", state)
        kernel.advance_to(kernel.now + PS_PER_MS)
    assert [channel for _, channel in tripped] == ["memory", "memory"]


def test_switched_off_channel_cannot_latch_up(kernel, power, tripped):
    power.switch("memory", False)
    power.latch_up("memory")
    power.switch("memory", True)
    kernel.advance_to(PS_PER_MS)
    assert tripped == []
    assert power.current_ma("memory") == PARTS["memory"].ma["standby"]


NO_STATE = r"memory has no state 'on', only \['standby', 'transfer'\]"
NO_CHANNEL = r"no supply channel 'radio', only \['imager', 'memory'\]"


@pytest.mark.parametrize(
    ("call", "arguments", "text"),
    [
        ("switch", ("radio", False), NO_CHANNEL),
        ("latch_up", ("radio",), NO_CHANNEL),
        ("current_ma", ("radio",), NO_CHANNEL),
        ("set_state", ("radio", "on"), r"no supplied part 'radio', only .*'fpga'"),
        ("set_state", ("memory", "on"), NO_STATE),
    ],
)
def test_unknown_names_are_rejected_without_effect(power, call, arguments, text):
    with pytest.raises(ValueError, match=text):
        getattr(power, call)(*arguments)
    assert power.current_ma() == pytest.approx(MODES[1][0], abs=0.005)


# CubeSense thesis, table 7.1: power in mW, and what the parts do then.
CUBESENSE_STATES = [
    (41.9, "reset", 0, 0, 0),
    (62.2, "on", 0, 0, 0),
    (84.2, "on", 1, 0, 0),
    (108.1, "on", 2, 0, 0),
    (246.8, "on", 2, 1, 0),
    (359.5, "on", 2, 2, 0),
    (396.4, "on", 2, 2, 1),
    (432.4, "on", 2, 2, 2),
]


@pytest.mark.parametrize(
    ("published_mw", "processor", "memories", "cameras", "sides"), CUBESENSE_STATES
)
def test_cubesense_states_draw_the_published_power(
    kernel, published_mw, processor, memories, cameras, sides
):
    power = PowerModel(kernel, CUBESENSE_POWER)
    power.set_state("processor", processor)
    for half, (memory, side) in enumerate((("1", "sun"), ("2", "nadir"))):
        power.switch(f"SRAM{memory}", half < memories)
        power.switch(f"{side}_camera", half < cameras)
        if half < sides:
            power.set_state(f"sram{memory}", "active")
            power.set_state(f"{side}_fpga", "imaging")
    assert power.current_ma() * CUBESENSE_POWER.volts == pytest.approx(published_mw, rel=0.06)


def test_channel_without_a_comparator_is_never_reported(kernel):
    power = PowerModel(kernel, CUBESENSE_POWER)
    power.on_overcurrent = lambda channel: pytest.fail(f"{channel} has no comparator")
    power.latch_up("SRAM1")
    kernel.advance_to(PS_PER_MS)
    assert power.current_ma("SRAM1") > 300

import pytest

from cubestack.firmware_model.aramis.settings import CONFIG_PAGE
from cubestack.firmware_model.aramis.state import Clock, State
from cubestack.firmware_model.interface.aramis import MS_PER_DAY, MeasurementOutcome, SensorState
from cubestack.firmware_model.interface.codec.field import InterfaceError
from cubestack.firmware_model.mcu.memory import FlashStore


def test_the_clock_counts_on_over_noon() -> None:
    clock = Clock()
    assert clock.at(123_000) == (0, 0)
    assert not clock.is_set
    clock.set(2_461_366, MS_PER_DAY - 10, 5_000_000)
    assert clock.is_set
    times = {5_000_000: (0, MS_PER_DAY - 10), 5_010_000: (1, 0), 4_990_000: (0, MS_PER_DAY - 20)}
    for uptime_us, (days, millisecond) in times.items():
        assert clock.at(uptime_us) == (2_461_366 + days, millisecond)
    clock.set(0, 0, 5_000_000)
    assert clock.at(1_000_000) == (0, 0)  # a time before the epoch is the epoch


def test_a_fresh_state() -> None:
    state = State(FlashStore())
    assert not state.active
    assert not state.measurement.valid
    state.measurement.outcome = MeasurementOutcome.CONCLUSIVE
    assert state.measurement.valid
    for sensor in SensorState:
        state.sensor = sensor
        inactive = sensor in (SensorState.INACTIVE, SensorState.ACTIVATING)
        assert state.active is not inactive


def test_unknown_flags_are_a_programming_error() -> None:
    with pytest.raises(InterfaceError, match="no error flag 'Nonsense'"):
        State(FlashStore()).raise_flag("Nonsense")


def test_damaged_settings_raise_their_flag() -> None:
    flash = FlashStore()
    flash.write(CONFIG_PAGE, b"rubbish")
    assert State(flash).flags == {"ConfigError"}

import pytest

from cubestack.firmware_model.aramis.settings import CONFIG_PAGE
from cubestack.firmware_model.aramis.state import Clock, State
from cubestack.firmware_model.interface.aramis import MS_PER_DAY, MeasurementOutcome, SensorState
from cubestack.firmware_model.mcu.flash_store import FlashStore


def test_the_clock_counts_on_over_noon() -> None:
    clock = Clock()
    assert clock.at(123_000) == (0, 0)
    assert not clock.is_set
    clock.set(2_461_366, MS_PER_DAY - 10, 5_000_000)
    assert clock.is_set
    assert clock.at(5_000_000) == (2_461_366, MS_PER_DAY - 10)
    assert clock.at(5_010_000) == (2_461_367, 0)
    assert clock.at(4_990_000) == (2_461_366, MS_PER_DAY - 20)


def test_a_time_before_the_epoch_is_the_epoch() -> None:
    clock = Clock()
    clock.set(0, 0, 5_000_000)
    assert clock.at(1_000_000) == (0, 0)


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
    with pytest.raises(KeyError, match="no flag 'Nonsense'"):
        State(FlashStore()).raise_flag("Nonsense")


def test_damaged_settings_raise_their_flag() -> None:
    flash = FlashStore()
    flash.write(CONFIG_PAGE, b"rubbish")
    assert State(flash).flags == {"ConfigError"}

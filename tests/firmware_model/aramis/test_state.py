from typing import Any

import pytest

from cubestack.firmware_model.aramis.settings import BODY_PAGE, CONFIG_PAGE, StoredSettings
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


TURN = {"Q0": 0.0, "Q1": 0.0, "Q2": 1.0, "Q3": 0.0}


def test_saved_settings_come_back_and_others_do_not() -> None:
    flash = FlashStore()
    settings = StoredSettings(flash)
    settings.put("SetGain", {"Gain": 4.0})
    settings.save()
    settings.put("SetExposure", {"Rows": 17})
    again = StoredSettings(flash)
    assert again.get("SetGain", "Gain") == 4.0
    assert again.get("SetExposure", "Rows") != 17
    again.erase()
    assert again.get("SetGain", "Gain") == 15.0
    assert StoredSettings(flash).get("SetGain", "Gain") == 15.0


def test_the_body_rotation_is_kept_at_once_and_survives_erasing_the_rest() -> None:
    flash = FlashStore()
    settings = StoredSettings(flash)
    settings.put("SetBodyRotation", TURN)
    settings.erase()
    assert StoredSettings(flash).all("SetBodyRotation") == TURN


@pytest.mark.parametrize("page", [CONFIG_PAGE, BODY_PAGE])
@pytest.mark.parametrize(
    "damage", [lambda b: b[:-1], lambda b: b"", lambda b: bytes([b[0] ^ 1]) + b[1:]]
)
def test_damaged_pages_are_noticed_and_left_out(page: str, damage: Any) -> None:
    flash = FlashStore()
    settings = StoredSettings(flash)
    settings.put("SetGain", {"Gain": 4.0})
    settings.save()
    settings.put("SetBodyRotation", TURN)
    flash.write(page, damage(flash.read(page)))
    again = StoredSettings(flash)
    assert again.damaged
    for key, command in {CONFIG_PAGE: "SetGain", BODY_PAGE: "SetBodyRotation"}.items():
        assert (again.all(command) == settings.all(command)) == (key != page)

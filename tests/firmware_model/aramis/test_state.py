from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cubestack.firmware_model.aramis.detection.mask import SpikeRemoval
from cubestack.firmware_model.aramis.measurement import Measuring, configuration
from cubestack.firmware_model.aramis.pipeline import VERIFIED, DetectionSettings
from cubestack.firmware_model.aramis.settings import BODY_PAGE, CONFIG_PAGE, StoredSettings
from cubestack.firmware_model.aramis.state import Clock, State
from cubestack.firmware_model.aramis.telemetry import body_quaternion
from cubestack.firmware_model.interface.aramis import (
    INTERFACE,
    MS_PER_DAY,
    MeasurementOutcome,
    SensorState,
)
from cubestack.firmware_model.interface.aramis.switches import AramisSwitches
from cubestack.firmware_model.interface.codec.field import InterfaceError
from cubestack.firmware_model.mcu.blackfin import BLACKFIN_BF533
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.memory import FlashStore


def test_julian_clock_continues_over_noon() -> None:
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


def test_new_state_is_inactive_and_without_a_measurement() -> None:
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


def test_only_saved_settings_are_restored() -> None:
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


def test_body_rotation_is_stored_at_once_and_survives_an_erase() -> None:
    flash = FlashStore()
    settings = StoredSettings(flash)
    settings.put("SetBodyRotation", TURN)
    settings.erase()
    assert StoredSettings(flash).all("SetBodyRotation") == TURN


@pytest.mark.parametrize("page", [CONFIG_PAGE, BODY_PAGE])
@pytest.mark.parametrize(
    "damage", [lambda b: b[:-1], lambda b: b"", lambda b: bytes([b[0] ^ 1]) + b[1:]]
)
def test_damaged_settings_pages_are_detected_and_ignored(page: str, damage: Any) -> None:
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


EXTENDED = AramisSwitches.of("extended")


def test_hint_is_the_boresight_of_a_conclusive_latest_measurement_only() -> None:
    """An older attitude is no hint for the next measurement."""
    state = State(FlashStore())
    measuring = Measuring(Meter(BLACKFIN_BF533), state, None, None)  # type: ignore[arg-type]
    assert measuring.latest_boresight() is None
    turn = Rotation.from_rotvec([0.3, -0.2, 0.1])
    state.quaternion = turn.as_quat().astype(np.float32)
    state.measurement.outcome = MeasurementOutcome.CONCLUSIVE
    assert measuring.latest_boresight() == pytest.approx(turn.as_matrix()[2], abs=1e-6)
    for outcome in set(MeasurementOutcome) - {MeasurementOutcome.CONCLUSIVE}:
        state.measurement.outcome = outcome
        assert measuring.latest_boresight() is None


def test_default_settings_select_the_verified_profile() -> None:
    found = configuration(StoredSettings(FlashStore()), EXTENDED)
    assert found.detection == VERIFIED.detection
    assert found.field.fov_deg == pytest.approx(VERIFIED.field.fov_deg, abs=1e-5)
    assert found.profile.sigma_rad == pytest.approx(VERIFIED.profile.sigma_rad, rel=0.01)
    assert found.profile.verify


def test_stored_settings_reach_the_measurement_configuration() -> None:
    settings = StoredSettings(FlashStore())
    settings.put("SetField", {"FieldOfView": 18.0, "Round": 0})
    sizes = {"MinPixels": 4, "MaxPixels": 99, "MaxStars": 12}
    settings.put("SetDetection", {"Sigmas": 3.5, "Spikes": 2, "Needed": 9, "Subtract": 0, **sizes})
    settings.put("SetIdentification", {"Noise": 0.5, "Pivots": 1, "Verify": 0, "HintTolerance": 9})
    found = configuration(settings, EXTENDED)
    assert (found.field.fov_deg, found.field.round) == (18.0, False)
    assert found.detection == DetectionSettings(
        3.5, SpikeRemoval.WINDOW, 9, 4, 99, 24, subtract=False, local=True
    )
    profile = found.profile
    assert profile.sigma_rad == pytest.approx(0.5 / 3232.64, rel=1e-4)
    assert (profile.pivots, profile.verify, profile.hint_tolerance_deg) == (1, False, 9)


def test_settings_do_not_override_printed_switches() -> None:
    settings, printed = StoredSettings(FlashStore()), AramisSwitches.of("published")
    before = configuration(settings, printed)
    assert not before.detection.subtract
    assert before.profile.sigma_rad == pytest.approx(0.26 * 0.3759 / 582, rel=1e-6)
    settings.put("SetIdentification", {"Noise": 0.5, "Pivots": 3, "Verify": 1, "HintTolerance": 6})
    assert configuration(settings, printed) == before
    settings.put("SetField", {"FieldOfView": 18.0, "Round": 1})
    likely = configuration(settings, printed).profile
    assert likely.sigma_rad == pytest.approx(0.26 * np.radians(18) / 582, rel=1e-3)


@given(st.data())
def test_processing_accepts_all_settings_allowed_by_the_tables(data: st.DataObject) -> None:
    settings = StoredSettings(FlashStore())
    for name in ("SetField", "SetDetection", "SetIdentification"):
        message = INTERFACE.telecommand(name)
        drawn = data.draw(st.binary(min_size=message.length, max_size=message.length))
        values = message.unpack(drawn)
        if not message.violations(values):
            settings.put(name, values)
    configuration(settings)


@given(st.integers(0, 2**32 - 1))
def test_body_quaternion_is_the_product_of_both_rotations(seed: int) -> None:
    turn, attitude = Rotation.random(2, random_state=np.random.default_rng(seed))
    found = body_quaternion(*(one.as_quat().astype(np.float32) for one in (turn, attitude)))
    assert ((turn * attitude).inv() * Rotation.from_quat(found)).magnitude() < 1e-6


def test_min_pixels_must_not_exceed_max_pixels() -> None:
    with pytest.raises(ValueError, match="min_pixels must be 1 to 8 px, not 9"):
        DetectionSettings(min_pixels=9, max_pixels=8)

"""RAM, retention registers and flash."""

from dataclasses import fields

import numpy as np
import pytest

from cubestack.firmware_model.cubestar.memory import RETENTION_BYTES
from cubestack.firmware_model.cubestar.state import Attitude, Retained, State
from cubestack.firmware_model.interface.codec.field import InterfaceError
from cubestack.firmware_model.interface.cubestar import INTERFACE, MatchMode
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.memory import FlashStore

COUNTERS = [field.name for field in fields(Retained)]
FLAGS = [field.name for field in INTERFACE.telemetry("ErrorFlags").fields]


class Memories:
    """The part of the hardware that the state uses."""

    def __init__(self) -> None:
        self.retention = bytearray(RETENTION_BYTES)
        self.flash = FlashStore()


@pytest.fixture
def memories() -> Memories:
    return Memories()


def state(memories: Memories) -> State:
    return State(memories, Meter(CORTEX_M3))  # type: ignore[arg-type]


def test_state_layout_fits_the_retention_registers(memories: Memories) -> None:
    assert State.RETENTION_SIZE <= RETENTION_BYTES
    state(memories).retain()
    assert len(memories.retention) == RETENTION_BYTES
    assert not any(memories.retention[State.RETENTION_SIZE :])


def test_counters_are_zero_after_power_up(memories: Memories) -> None:
    assert {name for name in COUNTERS if getattr(state(memories).retained, name)} == set()


def test_settings_flags_and_counters_are_retained(memories: Memories) -> None:
    before = state(memories)
    before.save_config()
    before.settings.put("Exposure", {"exposure": 1234})  # goes before the configuration
    before.flags |= set(FLAGS[::3])
    for number, name in enumerate(COUNTERS):
        setattr(before.retained, name, 2**40 + number)
    before.retain()
    after = state(memories)
    assert after.settings.get("Exposure", "exposure") == 1234
    assert after.flags == set(FLAGS[::3])
    assert after.retained == before.retained


@pytest.mark.parametrize("name", COUNTERS)
def test_a_counter_that_overflows_wraps(name: str, memories: Memories) -> None:
    before = state(memories)
    setattr(before.retained, name, 2**64 + 3)
    before.retain()
    assert getattr(state(memories).retained, name) == 3


def test_retention_registers_without_their_mark_are_ignored(memories: Memories) -> None:
    memories.retention[:] = np.random.default_rng(7).bytes(RETENTION_BYTES)
    fresh = state(memories)
    assert fresh.retained == Retained()
    assert fresh.flags == set()
    assert fresh.settings.pack() == state(Memories()).settings.pack()


def test_forget_restores_power_up_values_and_saved_settings(memories: Memories) -> None:
    before = state(memories)
    before.settings.put("Exposure", {"exposure": 5})
    before.save_config()
    before.settings.put("Exposure", {"exposure": 6})
    for name in COUNTERS:
        setattr(before.retained, name, 1)
    before.raise_flag("StatusError")
    before.forget()
    assert before.settings.get("Exposure", "exposure") == 5
    assert before.retained == Retained(cut=1)  # a switch that is open must be closed again
    assert before.flags == set()


def test_mode_flag_is_stored_and_written_only_on_change(memories: Memories) -> None:
    assert state(memories).mode is MatchMode.LOST_IN_SPACE
    for mode in MatchMode:
        state(memories).mode = mode
        assert state(memories).mode is mode
    writes = dict(memories.flash.writes)
    state(memories).mode = MatchMode.LOST_IN_SPACE
    assert memories.flash.writes == writes  # it is that already


def test_attitude_is_stored_in_single_precision(memories: Memories) -> None:
    assert state(memories).attitude is None
    quaternion = np.array([0.1, -0.2, 0.3, 0.9], np.float32)
    kept = Attitude(quaternion, 7, 123_456, 12, MatchMode.TRACKING)
    state(memories).attitude = kept
    found = state(memories).attitude
    assert found is not None
    assert found.quaternion.dtype == np.float32
    assert np.array_equal(found.quaternion, quaternion)
    assert (found.frame, found.image_ms, found.matched, found.mode) == (7, 123_456, 12, 0)


def test_frame_and_time_beyond_32_bits_wrap() -> None:
    far = Attitude(np.array([0, 0, 0, 1], np.float32), 2**32 + 5, 2**33 + 6, 3, 2)
    found = Attitude.unpack(far.pack())
    assert (found.frame, found.image_ms) == (5, 6)


def test_undeclared_flag_raises_interface_error() -> None:
    with pytest.raises(InterfaceError, match="no error flag 'Oops' in telemetry; known: "):
        state(Memories()).raise_flag("Oops")

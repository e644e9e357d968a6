import dataclasses
from itertools import combinations
from types import ModuleType

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.interface.cameras import mlx75412, mt9m001, ov7620
from cubestack.firmware_model.interface.cameras.registers import (
    BitField,
    CameraRegister,
    CameraRegisterMap,
    UnknownRegisterError,
)

GAIN = CameraRegister(0x10, "GAIN", 5, "amplifies", width=2)
CONTROL = CameraRegister(0x12, "CONTROL", 0, "switches").of(
    BitField("ON", 0, 1, "runs"), BitField("DEPTH", 5, 2, "bits")
)


def registers(*declared: CameraRegister) -> CameraRegisterMap:
    return CameraRegisterMap("TEST1", 0x21, 2, declared)


def test_lookup_by_name_and_by_any_address_of_the_register() -> None:
    table = registers(CONTROL, GAIN)
    assert table["GAIN"] is GAIN
    owners = [table.at(address) for address in range(0x0F, 0x14)]
    assert owners == [None, GAIN, GAIN, CONTROL, None]
    assert list(table) == [GAIN, CONTROL]  # in the order of addresses


@given(value=st.integers(0, 255))
def test_fields_take_their_bits_only(value: int) -> None:
    assert CONTROL.field("ON").of(value) == value & 1
    assert CONTROL.field("DEPTH").of(value) == (value & 0x60) // 0x20
    assert CONTROL.field("DEPTH").mask == 0x60


def test_declared_bits() -> None:
    assert CONTROL.bits == 0x61
    assert GAIN.bits == 0xFFFF


def test_unknown_names_are_named_with_the_known_ones() -> None:
    with pytest.raises(UnknownRegisterError, match=r"TEST1 has no register 'GAIM', only GAIN"):
        registers(GAIN)["GAIM"]
    with pytest.raises(UnknownRegisterError, match=r"no bit field .OF., only ON, DEPTH"):
        CONTROL.field("OF")
    with pytest.raises(UnknownRegisterError, match=r"only none"):
        GAIN.field("ON")


def test_rejects_overlapping_declarations() -> None:
    with pytest.raises(ValueError, match="GAIN and OTHER both have address 0x0011"):
        registers(GAIN, dataclasses.replace(CONTROL, name="OTHER", address=0x11))
    with pytest.raises(ValueError, match="declares register GAIN twice"):
        registers(GAIN, dataclasses.replace(GAIN, address=0x20))


@pytest.mark.parametrize("sensor", [mlx75412, mt9m001, ov7620], ids=lambda s: s.REGISTERS.camera)
def test_tables_are_consistent(sensor: ModuleType) -> None:
    for register in sensor.REGISTERS:
        assert 0 <= register.reset < 1 << (register.unit_bits * register.width)
        if sensor is not ov7620:  # which has bits that are set and not declared
            assert register.reset & ~register.bits == 0
        masks = [field.mask for field in register.fields]
        assert not any(one & other for one, other in combinations(masks, 2))
        assert register.modelled or not any(field.modelled for field in register.fields)

"""Runs a computation in C++ and in Python; results and charges must be equal to the bit."""

from collections.abc import Callable
from dataclasses import fields, is_dataclass

import numpy as np

from cubestack.emulator.sim.firmware_loops import offer_firmware_loops
from cubestack.firmware_model.mcu.costs import CostTable, Meter
from cubestack.firmware_model.mcu.inner_loops import loops_in_use, python_form


def assert_equal_forms(compute: Callable[[Meter], object], table: CostTable) -> object:
    """Compare both forms of ``compute``, which charges the meter; returns the result."""
    offer_firmware_loops()
    assert loops_in_use() is not None
    ours, reference = Meter(table), Meter(table)
    found = compute(ours)
    with python_form():
        assert_same(found, compute(reference))
    assert ours.total == reference.total
    assert dict(ours.counts) == dict(reference.counts)
    assert list(ours.phases.items()) == list(reference.phases.items())
    return found


def assert_same(one: object, other: object) -> None:
    """Equal type, shape and bits, down to the fields of dataclasses."""
    assert type(one) is type(other)
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        assert one.tobytes() == other.tobytes()
    elif isinstance(one, tuple | list) and isinstance(other, tuple | list):
        assert len(one) == len(other)
        for part, same in zip(one, other, strict=True):
            assert_same(part, same)
    elif is_dataclass(one):
        for field in fields(one):
            assert_same(getattr(one, field.name), getattr(other, field.name))
    elif isinstance(one, float):
        assert repr(one) == repr(other)  # nan too
    else:
        assert one == other

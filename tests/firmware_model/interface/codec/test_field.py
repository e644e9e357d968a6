import math
import struct
from decimal import ROUND_HALF_UP, Decimal
from enum import IntEnum
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.interface.codec.field import (
    Field,
    InterfaceError,
    bool1,
    byte_array,
    enum8,
    f32,
    i16,
    suggestion,
    u8,
    u16,
)


class Colour(IntEnum):
    RED = 1
    GREEN = 4


INTEGERS = {"u8": (0, 255), "u16": (0, 65535), "u32": (0, 2**32 - 1), "i16": (-32768, 32767)}


@pytest.mark.parametrize("kind", INTEGERS)
@given(data=st.data())
def test_every_raw_count_survives_decoding_and_encoding(kind: str, data: st.DataObject) -> None:
    low, high = INTEGERS[kind]
    field = Field("x", "", type=kind, scale=data.draw(st.sampled_from([1, 10, 50, 100, 10_000])))
    raw = data.draw(st.integers(low, high)) & ((1 << field.bits) - 1)
    assert field.encode(field.decode(raw), saturate=False) == raw


@given(st.integers(0, 2**32 - 1))
def test_float_fields_decode_ieee_754_bits(raw: int) -> None:
    value = f32("x", "").decode(raw)
    expected = struct.unpack("<f", struct.pack("<I", raw))[0]
    assert value == expected or (math.isnan(value) and math.isnan(expected))


@given(st.floats(-3.2767, 3.2767))
def test_rounding_is_half_away_from_zero(value: float) -> None:
    raw = i16("x", "", scale=10_000).encode(value, saturate=False)
    counts = Decimal(value * 10_000)
    expected = int(counts.quantize(Decimal(1), rounding=ROUND_HALF_UP))  # half away, in decimal
    assert raw == expected & 0xFFFF


@pytest.mark.parametrize(
    ("value", "raw"), [(0.5, 1), (-0.5, -1), (1.5, 2), (-2.5, -3), (0.49999999999999994, 0)]
)
def test_field_encoding_rounds_halves_away_from_zero(value: float, raw: int) -> None:
    assert i16("x", "").encode(value, saturate=False) == raw & 0xFFFF


@pytest.mark.parametrize("kind", INTEGERS)
def test_telemetry_saturates_and_telecommands_refuse(kind: str) -> None:
    low, high = INTEGERS[kind]
    field = Field("x", "", type=kind)
    for value, end in ((high + 1, high), (low - 1, low), (math.inf, high), (-math.inf, low)):
        assert field.decode(field.encode(value, saturate=True)) == end
        with pytest.raises(InterfaceError, match=f"x: .* does not fit; {kind} carries"):
            field.encode(value, saturate=False)


def test_nan_is_encoded_as_0_in_telemetry_and_refused_in_telecommands() -> None:
    field = i16("x", "")
    assert field.encode(math.nan, saturate=True) == 0
    with pytest.raises(InterfaceError, match="does not fit"):
        field.encode(math.nan, saturate=False)


def test_large_floats_become_infinite_in_telemetry_only() -> None:
    field = f32("x", "")
    assert field.decode(field.encode(-1e39, saturate=True)) == -math.inf
    assert field.decode(field.encode(math.inf, saturate=False)) == math.inf
    with pytest.raises(InterfaceError, match="x: 1e\\+39 is too large for a float32"):
        field.encode(1e39, saturate=False)


def test_bytes_keep_their_order_and_their_length() -> None:
    field = byte_array(3, "x", "")
    assert field.encode(b"\x01\x02\x03", saturate=False) == 0x030201
    assert field.decode(0x030201) == b"\x01\x02\x03"
    with pytest.raises(InterfaceError, match="x: has 2 bytes, must have 3"):
        field.encode(b"ab", saturate=True)
    with pytest.raises(InterfaceError, match="x: 7 is not bytes"):
        field.encode(7, saturate=True)


def test_choices_go_by_number_or_name() -> None:
    field = enum8("x", "", choices=Colour, reset=Colour.RED)
    assert field.encode("green", saturate=False) == field.encode(4, saturate=False) == 4
    assert field.label(4) == "GREEN"
    assert field.label(2) == "2"
    assert [field.allows(value, {}) for value in (0, 1, 2, 4)] == [False, True, False, True]
    with pytest.raises(InterfaceError, match="x: no choice 'gren'; did you mean GREEN\\?"):
        field.encode("gren", saturate=False)


def test_field_rejects_text_as_a_number() -> None:
    with pytest.raises(InterfaceError, match="x: '7' is not a number"):
        u8("x", "").encode("7", saturate=True)


@given(st.floats(width=32))
def test_float_limits_are_compared_in_single_precision(value: float) -> None:
    field = f32("x", "", low=-math.pi / 2, high=math.pi / 2)
    edge = struct.unpack("<f", struct.pack("<f", math.pi / 2))[0]
    assert field.allows(value, {}) == (math.isfinite(value) and abs(value) <= edge)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_float_without_limits_must_still_be_finite(value: float) -> None:
    assert not f32("x", "").allows(value, {})


def test_counts_without_a_scale_stay_integers() -> None:
    assert isinstance(u16("x", "").decode(5), int)
    assert isinstance(u16("x", "", scale=10).decode(50), float)
    assert bool1("x", "").decode(1) is True


def test_field_limit_may_depend_on_another_field() -> None:
    field = u16("x", "", high=100, high_by=("size", {0: 100, 1: 50}))
    assert field.allows(100, {"size": 0})
    assert not field.allows(51, {"size": 1})
    assert field.allows(100, {"size": 9})  # the size's own violation


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"type": "u12"}, "no type 'u12'; known: bool1"),
        ({"type": "bytes0"}, "no type 'bytes0'"),
        ({"gap": -8}, "a gap has no -8 bits"),
        ({"scale": 0}, "scale must be positive"),
    ],
)
def test_field_rejects_wrong_declarations(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(InterfaceError, match=message):
        Field(**{"type": "u8", "name": "x", "meaning": ""} | wrong)


def test_suggestions_name_the_nearest_or_all() -> None:
    assert suggestion("exposre", ["Exposure", "Reset"]) == "did you mean Exposure?"
    assert suggestion("qqq", ["Exposure", "Reset"]) == "known: Exposure, Reset"

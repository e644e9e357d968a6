from collections.abc import Callable
from dataclasses import replace
from enum import IntEnum
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.interface.cameras.registers import RegisterAccess
from cubestack.firmware_model.interface.codec import attitude_quality
from cubestack.firmware_model.interface.codec.field import (
    Field,
    InterfaceError,
    bool1,
    byte_array,
    f32,
    i16,
    u8,
    u16,
    u32,
)
from cubestack.firmware_model.interface.codec.message import Interface, Message, MessageKind
from cubestack.firmware_model.interface.codec.node_messages import AckError, node_telemetry
from cubestack.firmware_model.interface.codec.register_pointer import PointerMap, PointerRegister
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR

MIXED = Message(200, "Mixed", "").of(
    u8("a", ""), bool1("b", ""), bool1("c", "", gap=6), i16("d", "", scale=100), u32("e", "")
)

WINDOW = Message(20, "Window", "").of(
    u8("low", "", low=1, range_flag="LowError", reset=1),
    u8("high", "", high=9, range_flag="HighError", reset=9),
    ordered=(("low", "high"),),
)


def test_identification_telemetry_has_the_same_ids_for_every_node() -> None:
    """As CubeStar's: a host can identify an unknown node."""
    assert [message.id for message in node_telemetry(9, {})] == [128, 130, 131]
    assert CUBESTAR.telemetry("Identification").id == 128


def test_message_fields_are_packed_and_only_bits_share_a_byte() -> None:
    assert [field.bit_offset for field in MIXED.fields] == [0, 8, 15, 16, 32]
    assert MIXED.length == 8
    odd = Message(201, "Odd", "").of(bool1("a", ""), bool1("b", ""), u16("c", ""), bool1("d", ""))
    assert [field.bit_offset for field in odd.fields] == [0, 1, 8, 24]
    assert odd.length == 4
    assert Message(202, "Part", "").of(odd.fields[3]).length == 1  # a field has no fixed place


def test_bytes_are_little_endian_and_bits_count_from_the_lowest() -> None:
    data = MIXED.pack(a=0x12, b=True, c=True, d=-1.0, e=0x01020304)
    assert data == bytes.fromhex("12 81 9cff 04030201")


@given(st.binary(min_size=8, max_size=8))
def test_message_round_trip_keeps_every_declared_bit(data: bytes) -> None:
    packed = MIXED.pack(**MIXED.unpack(data))
    assert packed == bytes((data[0], data[1] & 0x81)) + data[2:]


COUNTS = (f32("f", ""), u8("a", ""), bool1("b", ""), bool1("c", "", gap=6), u32("e", ""))
SCALED = (u16("a", "", scale=10), f32("f", "", scale=2), byte_array(2, "g", ""))

ANY_VALUE = st.one_of(
    st.booleans(),
    st.integers(-2, 300),
    st.integers(-(2**40), 2**40),
    st.floats(),
    st.floats(width=32).map(np.float32),
    st.integers(-300, 300).map(np.int64),
    st.binary(max_size=3),
    st.sampled_from(["on", None, b"ab", np.True_, 0.5, -0.5, 1e39]),
)


def field_by_field(message: Message, values: dict[str, Any]) -> bytes:
    whole, saturate = 0, message.kind is MessageKind.TELEMETRY
    for field in message.fields:
        whole |= field.encode(values[field.name], saturate=saturate) << field.bit_offset
    return whole.to_bytes(message.length, "little")


def result_of(call: Callable[[], bytes]) -> bytes | str:
    try:
        return call()
    except InterfaceError as error:
        return str(error)


@pytest.mark.parametrize("number", [20, 200])
@pytest.mark.parametrize("fields", [COUNTS, SCALED, MIXED.fields])
@given(data=st.data())
def test_message_has_the_bits_of_its_fields_or_their_first_error(
    fields: tuple[Field, ...], number: int, data: st.DataObject
) -> None:
    message = Message(number, "M", "").of(*fields)
    values = {field.name: data.draw(ANY_VALUE) for field in fields}
    expected = result_of(lambda: field_by_field(message, values))
    if not isinstance(expected, bytes):
        assert result_of(lambda: message.pack(**values)) == f"M: {expected}"
        return
    assert message.pack(**values) == expected
    whole, found = int.from_bytes(expected, "little"), message.unpack(expected)
    assert list(found) == [field.name for field in fields]
    for field in message.fields:
        value = field.decode(whole >> field.bit_offset & ((1 << field.bits) - 1))
        assert repr(found[field.name]) == repr(value)


def test_telemetry_saturates_and_telecommands_do_not() -> None:
    assert (MIXED.kind, WINDOW.kind) == (MessageKind.TELEMETRY, MessageKind.TELECOMMAND)
    assert MIXED.pack(a=999, b=0, c=0, d=0, e=0)[0] == 255
    with pytest.raises(InterfaceError, match="Window: field low: 256 does not fit"):
        WINDOW.pack(low=256, high=9)


def test_values_beyond_the_limits_can_be_sent_for_the_node_to_refuse() -> None:
    assert WINDOW.pack(low=0, high=255) == b"\x00\xff"


@pytest.mark.parametrize(
    ("values", "flags"),
    [
        ((1, 9), []),
        ((5, 5), []),
        ((0, 9), ["LowError"]),
        ((0, 10), ["LowError", "HighError"]),
        ((6, 5), ["LowError"]),
    ],
)
def test_violations_name_the_flag(values: tuple[int, int], flags: list[str]) -> None:
    found = WINDOW.violations({"low": values[0], "high": values[1]})
    assert [flag for _, flag in found] == flags


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: WINDOW.pack(low=1, hihg=2), "Window has no field 'hihg'; did you mean high?"),
        (lambda: WINDOW.pack(low=1), "Window needs a value for high"),
        (lambda: WINDOW.field("q"), "Window has no field 'q'; known: low, high"),
        (lambda: Message(2, "Reset", "").pack(now=1), "Reset has no field 'now'; it has no"),
        (lambda: WINDOW.unpack(b"abc"), "Window has 2 bytes, not 3"),
    ],
)
def test_message_errors_name_the_field_in_one_line(
    call: Callable[[], object], message: str
) -> None:
    with pytest.raises(InterfaceError) as caught:
        call()
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def declared(*fields: Field, number: int = 1, **more: Any) -> Message:
    return Message(number, "M", "").of(*fields, **more)


def node_of(*telecommands: Message, telemetries: tuple[Message, ...] = ()) -> Interface:
    return Interface("Node", 1, 0x1A, 57_600, telecommands, telemetries, AckError)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: declared(u8("a", ""), u8("a", "")), "two fields of one name"),
        (lambda: declared(number=256), "ID 256 is not a byte"),
        (lambda: declared(u8("a", "", low=1)), "reset value of a"),
        (lambda: declared(u8("a", "", high_by=("z", {}))), "no field 'z'"),
        (lambda: declared(u8("a", ""), ordered=(("a", "z"),)), "no field 'z'"),
        (lambda: node_of(MIXED), "Mixed: ID 200 is no telecommand's"),
        (lambda: node_of(telemetries=(WINDOW,)), "Window: ID 20 is no telemetry's"),
        (lambda: node_of(WINDOW, Message(20, "Other", "")), "Other: ID 20 is taken"),
        (lambda: node_of(WINDOW, Message(21, "window", "")), "two telecommands of one name"),
        (lambda: NODE.telecommand("windw"), "Node has no telecommand 'windw'; did you mean Wind"),
        (lambda: NODE.telemetry(131), "Node has no telemetry frame 131; known: Mixed"),
    ],
)
def test_message_rejects_wrong_declarations(call: Callable[[], object], message: str) -> None:
    with pytest.raises(InterfaceError, match=message):
        call()


NODE = node_of(WINDOW, telemetries=(MIXED,))


def test_messages_and_fields_are_found_by_name_in_any_case() -> None:
    assert WINDOW.field("LOW").name == "low"
    assert NODE.telecommand("window") is NODE.telecommand(20) is NODE.find(20) is WINDOW
    assert NODE.telemetry("MIXED") is NODE.telemetry(200) is NODE.find(200) is MIXED
    assert NODE.find(21) is None


def test_unsupported_message_is_declared_but_not_found_by_id() -> None:
    later = Message(201, "Later", "", supported=False)
    node = node_of(telemetries=(later,))
    assert node.telemetry("Later") is later
    assert node.find(201) is None


def test_interface_choices_include_registers_but_not_error_codes() -> None:
    class Level(IntEnum):
        LOW = 0

    error = Message(201, "Last", "").of(u8("error", "", choices=AckError))
    register = PointerRegister(0, RegisterAccess.READ_WRITE, u8("level", "", choices=Level))
    bare = node_of(telemetries=(error,))
    assert bare.choices == ()
    assert replace(bare, registers=PointerMap(0x1C, (register,))).choices == (Level,)


@given(st.integers(0, 2**32 - 1))
def test_covariance_round_trips_through_the_message(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3)) * 10.0 ** rng.uniform(-6, -2, size=(3, 1))
    covariance = root @ root.T
    frame = Message(1, "Quality", "of a test").of(*attitude_quality.ATTITUDE_QUALITY)
    values = attitude_quality.UNRATED | attitude_quality.covariance_fields(covariance.tolist())
    read = np.array(attitude_quality.read_covariance(frame.unpack(frame.pack(**values))))
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    assert np.all(np.abs(read - covariance) <= 1e-6 * scale)


def test_unrated_quality_has_an_unknown_covariance() -> None:
    covariance = attitude_quality.read_covariance(attitude_quality.UNRATED)
    np.testing.assert_allclose(covariance, np.pi**2 * np.eye(3))


@pytest.mark.parametrize("wrong", [{"SigmaY": -1e-3}, {"CorrelationYZ": 1.25}, {"SigmaX": np.nan}])
def test_invalid_covariance_fields_raise_value_error(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="sigmas must be 0 or more and correlations within 1"):
        attitude_quality.read_covariance(attitude_quality.UNRATED | wrong)


def test_zero_false_alarm_probability_has_a_finite_logarithm() -> None:
    assert attitude_quality.log_false_alarm(0.0) == -30
    assert attitude_quality.log_false_alarm(1e-4) == pytest.approx(-4)

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.interface.cameras.registers import RegisterAccess
from cubestack.firmware_model.interface.codec.field import (
    InterfaceError,
    bool1,
    byte_array,
    i16,
    u8,
)
from cubestack.firmware_model.interface.codec.letters import Letter, LetterProtocol
from cubestack.firmware_model.interface.codec.register_pointer import PointerMap, PointerRegister

_RW, _RO, _WO = (RegisterAccess.READ_WRITE, RegisterAccess.READ_ONLY, RegisterAccess.WRITE_ONLY)
LEVEL = PointerRegister(0x10, _RW, u8("LEVEL", "", high=9))
CENTRE = PointerRegister(0x20, _RO, i16("CENTRE", "", "px", 100))
START = PointerRegister(0x30, _WO, u8("START", ""))
STREAM = PointerRegister(0x40, _RO, byte_array(5, "STREAM", ""))
MAP = PointerMap(0x1C, (STREAM, LEVEL, CENTRE, START))


@given(st.integers(-32768, 32767))
def test_two_bytes_are_signed_with_the_most_significant_first(raw: int) -> None:
    data = raw.to_bytes(2, "big", signed=True)
    assert CENTRE.decode(data) == raw / 100
    assert CENTRE.encode(raw / 100) == data


def test_measurements_saturate_and_writes_do_not() -> None:
    assert CENTRE.encode(1e6) == b"\x7f\xff"
    assert CENTRE.encode(-1e6) == b"\x80\x00"
    with pytest.raises(InterfaceError, match="LEVEL: 256 does not fit"):
        LEVEL.encode(256, saturate=False)


def test_register_write_limits_are_checked() -> None:
    assert [LEVEL.allows(value) for value in (0, 9, 10)] == [True, True, False]
    assert not CENTRE.allows(0)
    assert START.allows(255)
    assert [r.readable for r in MAP] == [True, True, False, True]


def test_stream_register_decodes_to_raw_bytes() -> None:
    assert STREAM.decode(b"abcde") == b"abcde"
    assert [r.streams for r in MAP] == [False, False, False, True]


def test_registers_are_found_by_name_and_address() -> None:
    assert list(MAP) == [LEVEL, CENTRE, START, STREAM]
    assert MAP["centre"] is MAP.at(0x20) is CENTRE
    assert MAP.at(0x21) is None


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: MAP["LEVL"], "no register 'LEVL'; did you mean LEVEL?"),
        (lambda: CENTRE.decode(b"a"), "register CENTRE has 2 bytes, not 1"),
        (lambda: STREAM.encode(1), "register STREAM is a stream"),
        (lambda: PointerRegister(256, _RO, u8("A", "")), "address 256 is not a byte"),
        (lambda: PointerRegister(0, _RO, bool1("A", "")), "must be whole bytes"),
        (lambda: PointerRegister(0, _RW, i16("A", "")), "writes one byte, not 2"),
        (lambda: PointerMap(1, (LEVEL, LEVEL)), "both have address 0x10"),
        (
            lambda: PointerMap(1, (LEVEL, PointerRegister(0, _RO, u8("level", "")))),
            "two registers are called",
        ),
    ],
)
def test_register_map_errors_name_the_register(call: Callable[[], object], message: str) -> None:
    with pytest.raises(InterfaceError) as caught:
        call()
    assert message in str(caught.value)


TAKE = Letter("a", "TAKE", "", 1, b"Y")
SEND = Letter("s", "SEND", "", 1000)


def test_bench_letters_are_found_by_their_byte() -> None:
    bench = LetterProtocol(115_200, (TAKE, SEND))
    assert (bench.find(ord("a")), bench.find(0), TAKE.request) == (TAKE, None, b"a")


def test_letter_protocol_rejects_wrong_declarations() -> None:
    for letter in ("", "ab", "é"):
        with pytest.raises(ValueError, match="is not one ASCII character"):
            Letter(letter, "X", "", 1)
    with pytest.raises(ValueError, match="its answer has 1 bytes, not 2"):
        Letter("x", "X", "", 2, b"Y")
    for other in (Letter("a", "X", "", 1), Letter("x", "TAKE", "", 1)):
        with pytest.raises(ValueError, match="must differ in both"):
            LetterProtocol(9600, (TAKE, other))

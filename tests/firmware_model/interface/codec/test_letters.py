import pytest

from cubestack.firmware_model.interface.codec.letters import Letter, LetterProtocol

TAKE = Letter("a", "TAKE", "", 1, b"Y")
SEND = Letter("s", "SEND", "", 1000)


def test_lookup_by_byte_and_by_name() -> None:
    bench = LetterProtocol(115_200, (TAKE, SEND))
    assert bench.find(ord("a")) is bench["TAKE"] is TAKE
    assert bench.find(0) is None
    assert TAKE.request == b"a"
    with pytest.raises(ValueError, match="no letter 'TAK'; known: TAKE, SEND"):
        bench["TAK"]


def test_wrong_declarations_are_refused() -> None:
    for letter in ("", "ab", "é"):
        with pytest.raises(ValueError, match="is not one ASCII character"):
            Letter(letter, "X", "", 1)
    with pytest.raises(ValueError, match="its answer has 1 bytes, not 2"):
        Letter("x", "X", "", 2, b"Y")
    for other in (Letter("a", "X", "", 1), Letter("x", "TAKE", "", 1)):
        with pytest.raises(ValueError, match="must differ in both"):
            LetterProtocol(9600, (TAKE, other))

import pytest

from cubestack.firmware_model.interface.codec.letters import Letter, LetterProtocol

TAKE = Letter("a", "TAKE", "", 1, b"Y")
SEND = Letter("s", "SEND", "", 1000)


def test_lookup_by_byte() -> None:
    bench = LetterProtocol(115_200, (TAKE, SEND))
    assert (bench.find(ord("a")), bench.find(0), TAKE.request) == (TAKE, None, b"a")


def test_rejects_wrong_declarations() -> None:
    for letter in ("", "ab", "é"):
        with pytest.raises(ValueError, match="is not one ASCII character"):
            Letter(letter, "X", "", 1)
    with pytest.raises(ValueError, match="its answer has 1 bytes, not 2"):
        Letter("x", "X", "", 2, b"Y")
    for other in (Letter("a", "X", "", 1), Letter("x", "TAKE", "", 1)):
        with pytest.raises(ValueError, match="must differ in both"):
            LetterProtocol(9600, (TAKE, other))

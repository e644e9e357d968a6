"""One-letter protocols of service ports as data: a letter is a request with a fixed answer length.

A host sends one byte and waits for the whole answer; there are no frames and no error codes. Other
bytes get no answer.
"""

from dataclasses import dataclass
from itertools import combinations


@dataclass(frozen=True)
class Letter:
    """A request of one ASCII character; ``answer`` if it is always the same."""

    letter: str
    name: str
    meaning: str
    length: int
    answer: bytes | None = None

    def __post_init__(self) -> None:
        if len(self.letter) != 1 or not self.letter.isascii():
            raise ValueError(f"letter {self.name}: {self.letter!r} is not one ASCII character")
        if self.answer is not None and len(self.answer) != self.length:
            raise ValueError(
                f"letter {self.name}: its answer has {len(self.answer)} bytes, not {self.length}"
            )

    @property
    def request(self) -> bytes:
        return self.letter.encode("ascii")


@dataclass(frozen=True)
class LetterProtocol:
    """All letters of a port (8N1), in the order of a listing."""

    baud: int
    letters: tuple[Letter, ...]

    def __post_init__(self) -> None:
        for other, letter in combinations(self.letters, 2):
            if letter.letter == other.letter or letter.name == other.name:
                raise ValueError(
                    f"letters {other.name} ({other.letter!r}) and {letter.name} "
                    f"({letter.letter!r}) must differ in both"
                )

    def find(self, byte: int) -> Letter | None:
        return next((letter for letter in self.letters if letter.request[0] == byte), None)

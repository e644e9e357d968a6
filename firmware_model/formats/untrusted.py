"""Data from outside: all files and messages of others are read by these functions.

They accept regular files only, and bound size, nesting, digits and characters, so that what they
return takes little time and memory and can be stored, computed with and printed. Every error is one
line that begins with the name of the file or message. The bounds are the constants below; a test
finds readers elsewhere.
"""

import json
import math
import os
import re
import stat
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from io import BufferedReader
from pathlib import Path
from typing import Any

LARGEST_TEXT = 8 << 20
"""Bytes of a TOML or JSON document."""

LARGEST_FILE = 256 << 20
"""Bytes of another file that is held in memory."""

LARGEST_PICTURE = 128 << 20
"""Bytes of the file of a picture."""

LARGEST_IMAGE = 64 << 20
"""Bytes of the file of a program, with its symbols."""

LONGEST_LINE = 48 << 20
"""Bytes of one line of a file that is read line by line."""

DEEPEST = 32
"""Most lists and tables inside one another."""

LONGEST_KEY = 32
"""Most parts of a dotted TOML key."""

LARGEST_INTEGER = 10**24
"""Above every time in ps that is in use."""


class UntrustedError(ValueError):
    """Data that is not accepted; the text is one line."""


Refusal = Callable[[str], Exception]
"""Makes the error of a text, as a class of exceptions does."""


_folders: ContextVar[Path | None] = ContextVar(
    "folder of the files that can be opened", default=None
)


@contextmanager
def confined(folder: Path) -> Iterator[None]:
    """Have every path within the block name a file of ``folder``, by its last part.

    For data that arrived together with the files that it names, such as a recorded scene.
    """
    token = _folders.set(folder)
    try:
        yield
    finally:
        _folders.reset(token)


@contextmanager
def opened(path: Path, largest: int, error: Refusal = UntrustedError) -> Iterator[BufferedReader]:
    """A regular file of at most ``largest`` bytes, open for reading.

    A FIFO or device is not waited for. Raises ``error``, and OSError if it cannot be opened.
    """
    folder = _folders.get()
    place = path if folder is None else folder / path.name
    try:
        number = os.open(place, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC)
    except FileNotFoundError:
        if folder is None:
            raise
        raise error(
            f"the file {shown(path.name)} did not come with the text that names it"
        ) from None
    except ValueError:  # a NUL in the name
        raise error(f"{shown(str(path))} is not a name of a file") from None
    found = os.fstat(number)
    if not stat.S_ISREG(found.st_mode):
        os.close(number)
        kind = "a folder" if stat.S_ISDIR(found.st_mode) else "a device, pipe or socket"
        raise error(f"{shown(str(path))} is {kind}, not a regular file")
    with open(number, "rb") as stream:
        if found.st_size > largest:
            raise error(_too_large(str(path), found.st_size, largest))
        yield stream


def read_bytes(path: Path, largest: int = LARGEST_FILE, error: Refusal = UntrustedError) -> bytes:
    """The content of a file; raises as ``opened``."""
    with opened(path, largest, error) as stream:
        content = stream.read(largest + 1)  # files of /proc have the size 0
    if len(content) > largest:
        raise error(_too_large(str(path), len(content), largest))
    return content


def read_text(path: Path, largest: int = LARGEST_TEXT, error: Refusal = UntrustedError) -> str:
    """The text of a UTF-8 file, with "\\n" at the end of lines; raises as ``opened``."""
    try:
        text = read_bytes(path, largest, error).decode("utf-8")
    except UnicodeDecodeError as found:
        raise error(f"{shown(str(path))} is not UTF-8 text: byte {found.start}") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_lines(
    path: Path, largest: int, error: Refusal = UntrustedError
) -> Iterator[tuple[int, bytes]]:
    """Number, from 1, and bytes of each line of a file; raises as ``opened``."""
    with opened(path, largest, error) as stream:
        number, left = 0, largest
        while line := stream.readline(LONGEST_LINE + 1):
            number, left = number + 1, left - len(line)
            if len(line) > LONGEST_LINE:
                raise error(
                    f"{shown(str(path))}: line {number} is longer than {LONGEST_LINE} bytes"
                )
            if left < 0:
                raise error(_too_large(str(path), largest - left, largest))
            yield number, line


def read_toml(path: Path, error: Refusal = UntrustedError) -> dict[str, Any]:
    """The table of a TOML file; raises as ``opened``."""
    return parse_toml(read_text(path, error=error), str(path), error)


def parse_toml(text: str, name: str, error: Refusal = UntrustedError) -> dict[str, Any]:
    """The table of a TOML document; ``name`` begins the text of an error."""
    _check_length(text, name, error)
    if _DOTTED.search(text):
        raise error(f"{shown(name)}: a key has more than {LONGEST_KEY} parts")
    try:
        table = tomllib.loads(text)
    except RecursionError:
        raise error(f"{shown(name)}: {_NESTED}") from None
    except ValueError as found:
        raise error(f"{shown(name)} is not a TOML file: {shown(str(found))}") from None
    _check(table, name, error)
    return table


def read_json(path: Path, error: Refusal = UntrustedError, *, finite: bool = True) -> Any:
    """The value of a JSON file, as ``parse_json``; raises as ``opened``."""
    return parse_json(read_text(path, error=error), str(path), error, finite=finite)


def parse_json(
    text: str | bytes,
    name: str,
    error: Refusal = UntrustedError,
    *,
    finite: bool = True,
    largest: int = LARGEST_TEXT,
) -> Any:
    """The value of a JSON document, unless ``finite`` is false without NaN and infinite numbers.

    ``name`` begins the text of an error; empty for none.
    """
    _check_length(text, name, error, largest)
    what = f"{shown(name)} is not" if name else "not"
    try:
        plain = text if isinstance(text, str) else text.decode("utf-8")
    except UnicodeDecodeError as found:
        raise error(f"{what} UTF-8 text: byte {found.start}") from None
    try:
        value = (_JSON if finite else _ANY_JSON).decode(plain)
    except RecursionError:
        raise error(_named(name, _NESTED)) from None
    except ValueError as found:
        raise error(f"{what} valid JSON: {shown(str(found))}") from None
    _check(value, name, error, finite)
    return value


def shown(text: str) -> str:
    """``text`` on one line, with escapes for characters that a terminal would obey."""
    return text if text.isprintable() else "".join(map(_visible, text))


def shown_lines(text: str) -> str:
    """As ``shown``, but line breaks and tabs stay."""
    if text.isprintable():
        return text
    return "".join(one if one in "\n\t" else _visible(one) for one in text)


_NESTED = f"lists and tables are nested more than {DEEPEST} deep"

_WORD = r"[\w\"'-]"
_DOTTED = re.compile(rf"(?<!{_WORD}){_WORD}++(?:[ \t]*+\.[ \t]*+{_WORD}++){{{LONGEST_KEY},}}")


def _visible(character: str) -> str:
    if character.isprintable():
        return character
    return character.encode("unicode_escape", "surrogatepass").decode("ascii")


def _named(name: str, text: str) -> str:
    return f"{shown(name)}: {text}" if name else text


def _too_large(name: str, size: int, largest: int) -> str:
    return f"{shown(name)} has {size} bytes; at most {largest} are read"


def _check_length(
    text: str | bytes, name: str, error: Refusal, largest: int = LARGEST_TEXT
) -> None:
    if len(text) > largest:
        raise error(_too_large(name, len(text), largest))


def _refuse_constant(word: str) -> None:
    raise ValueError(f"{word} is not a number of JSON")


_JSON = json.JSONDecoder(parse_constant=_refuse_constant)
_ANY_JSON = json.JSONDecoder()


def _check(value: Any, name: str, error: Refusal, finite: bool = True) -> None:
    """Raise ``error`` for deep nesting, huge numbers, and texts that UTF-8 does not have."""
    level, depth = [value], 0
    while level:
        deeper: list[Any] = []
        for one in level:
            if isinstance(one, str):
                if not one.isascii() and _SURROGATE.search(one):
                    raise error(_named(name, f"{shown(one[:40])!r} is not valid Unicode"))
            elif isinstance(one, dict | list) and depth == DEEPEST:
                raise error(_named(name, _NESTED))
            elif isinstance(one, dict):
                deeper += one.keys()
                deeper += one.values()
            elif isinstance(one, list):
                deeper += one
            elif isinstance(one, int):
                if not -LARGEST_INTEGER < one < LARGEST_INTEGER:
                    raise error(_named(name, "an integer has more than 24 digits"))
            elif finite and isinstance(one, float) and not math.isfinite(one):
                raise error(_named(name, f"{one} is no finite number"))
        level, depth = deeper, depth + 1


_SURROGATE = re.compile("[\ud800-\udfff]")

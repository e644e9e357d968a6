"""What comes from outside is bounded, and an error is one line that begins with its name."""

import os
import socket
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.formats import untrusted
from cubestack.firmware_model.formats.untrusted import (
    UntrustedError,
    confined,
    parse_json,
    parse_toml,
    read_bytes,
    read_lines,
    read_text,
    shown,
    shown_lines,
)

DEEP = untrusted.DEEPEST + 1


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[" * 100_000, "nested more than"),
        ("[" * DEEP + "]" * DEEP, "nested more than"),
        ('{"a":' * DEEP + "1" + "}" * DEEP, "nested more than"),
        ("9" * 5000, "4300 digits"),
        ("9" * 25, "more than 24 digits"),
        ("1e400", "no finite number"),
        ("NaN", "NaN is not a number"),
        ('{"a": -Infinity}', "-Infinity is not a number"),
        (r'["\ud800"]', "not valid Unicode"),
        (r'{"\udfff": 1}', "not valid Unicode"),
        ("{", "not valid JSON"),
        ("", "not valid JSON"),
        ("1 2", "not valid JSON"),
    ],
)
def test_json_that_is_rejected(text: str, reason: str) -> None:
    for document in (text, text.encode()):
        with pytest.raises(UntrustedError, match=reason) as caught:
            parse_json(document, "x.json")
        assert str(caught.value).startswith("x.json")
        assert str(caught.value).isprintable()


def test_largest_json_that_is_accepted() -> None:
    nested = "[" * untrusted.DEEPEST + "]" * untrusted.DEEPEST
    assert parse_json(nested, "x") is not None
    assert parse_json("9" * 24, "x") == 10**24 - 1
    with pytest.raises(UntrustedError, match="at most 10 are read"):
        parse_json("[1,2,3,4,5]", "x", largest=10)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("x = " + "[" * 5000 + "]" * 5000, "nested more than"),
        ("x = " + "{a=" * 3000 + "1" + "}" * 3000, "nested more than"),
        (".".join(["a"] * 20_000) + " = 1", "a key has more than"),
        (f"[{' . '.join(['a'] * 5000)}]\nx = 1", "a key has more than"),
        ("x = nan", "no finite number"),
        ("x = -inf", "no finite number"),
        ("x = " + "9" * 400, "more than 24 digits"),
        ("x = 1\nx = 2", "not a TOML file"),
        ('"\\u001b[31m" = \x00', "not a TOML file"),
    ],
)
def test_toml_that_is_rejected(text: str, reason: str) -> None:
    with pytest.raises(UntrustedError, match=reason) as caught:
        parse_toml(text, "x.toml")
    assert str(caught.value).startswith("x.toml")
    assert str(caught.value).isprintable()


def test_long_words_without_dots_take_no_time() -> None:
    assert parse_toml("k" * 1_000_000 + " = 1", "x")
    assert parse_toml("x = '" + "One word. Two words more. " * 1000 + "'", "x")


@pytest.mark.parametrize("kind", ["fifo", "folder", "socket", "device"])
def test_only_regular_files_are_read(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "x"
    if kind == "fifo":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "device":
        path = Path("/dev/zero")
    with socket.socket(socket.AF_UNIX) as server:
        if kind == "socket":
            server.bind(str(path))
        with pytest.raises((UntrustedError, OSError)) as caught:
            read_bytes(path)
    if kind != "socket":  # open(2) itself rejects it
        assert "not a regular file" in str(caught.value)


def test_size_is_bounded_even_if_the_file_does_not_tell_it(tmp_path: Path) -> None:
    path = tmp_path / "x"
    path.write_bytes(b"12345\n" * 10)
    with pytest.raises(UntrustedError, match="has 60 bytes; at most 59"):
        read_bytes(path, 59)
    with pytest.raises(UntrustedError, match="at most 5 are read"):
        read_bytes(Path("/proc/self/maps"), 5)
    assert [number for number, _ in read_lines(path, 60)] == [*range(1, 11)]


def test_long_lines_are_rejected(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(untrusted, "LONGEST_LINE", 8)
    path = tmp_path / "x"
    path.write_bytes(b"1234567\n12345678\n")
    with pytest.raises(UntrustedError, match="line 2 is longer than 8 bytes"):
        list(read_lines(path, 100))


def test_text_must_be_utf8(tmp_path: Path) -> None:
    path = tmp_path / "x"
    path.write_bytes(b"a\r\nb\xff")
    with pytest.raises(UntrustedError, match="not UTF-8 text: byte 4"):
        read_text(path)
    path.write_bytes(b"a\r\nb\rc")
    assert read_text(path) == "a\nb\nc"


def test_confined_reads_open_files_of_one_folder_only(tmp_path: Path) -> None:
    inside, outside = tmp_path / "in", tmp_path / "out"
    for folder in (inside, outside):
        folder.mkdir()
        (folder / "x").write_text(folder.name)
    (outside / "y").touch()
    with confined(inside):
        assert read_text(outside / "x") == "in"
        assert read_text(Path("../../x")) == "in"
        for name in (outside / "y", Path("/etc/passwd"), Path("..")):
            with pytest.raises(UntrustedError):
                read_bytes(name)
    assert read_text(outside / "x") == "out"


@given(st.text())
def test_shown_text_is_printable(text: str) -> None:
    assert shown(text).isprintable()
    assert shown(text) == text or not text.isprintable()
    assert not set(shown_lines(text)) - {"\n", "\t"} or shown(shown_lines(text)) is not None


def test_escape_sequences_are_shown() -> None:
    assert shown("a\x1b[31mb\nc\x9b") == "a\\x1b[31mb\\nc\\x9b"
    assert shown_lines("a\x1b\n\tb") == "a\\x1b\n\tb"

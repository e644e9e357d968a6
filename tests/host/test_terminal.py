"""How far a long work is."""

from collections.abc import Iterator
from threading import Event

import pytest

from cubestack.host import terminal


def test_off_a_terminal_lines_tell_how_far_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    lines, heard = list[str](), Event()

    def say(text: str) -> None:
        lines.append(text)
        heard.set()

    monkeypatch.setattr(terminal, "EVERY_S", 0.01)
    monkeypatch.setattr(terminal, "say", say)

    def slow() -> Iterator[int]:
        for number in range(3):
            assert heard.wait(10.0)  # one takes as long as it does
            heard.clear()
            yield number

    assert list(terminal.progress(slow(), 3, "measuring")) == [0, 1, 2]
    assert lines[0] == "measuring: 0 of 3"
    assert any(line.startswith("measuring: 2 of 3, ") for line in lines)
    assert all(line.endswith(" s left") for line in lines[1:] if "0 of 3" not in line)


def test_what_was_done_before_tells_nothing_about_the_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    lines, heard = list[str](), Event()
    monkeypatch.setattr(terminal, "EVERY_S", 0.01)
    monkeypatch.setattr(terminal, "say", lambda text: (lines.append(text), heard.set()))

    def items() -> Iterator[int]:
        yield from range(1000)
        assert heard.wait(10.0)

    assert len(list(terminal.progress(items(), 1001, "measuring", before=1000))) == 1000
    assert lines[-1] == "measuring: 1000 of 1001"


def test_quick_or_quiet_work_says_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    assert list(terminal.progress([1, 2], 2, "measuring")) == [1, 2]
    assert list(terminal.progress([1, 2], 2, "measuring", quiet=True)) == [1, 2]
    assert capfd.readouterr() == ("", "")

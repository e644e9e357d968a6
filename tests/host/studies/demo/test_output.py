from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from cubestack.host.errors import PortClosedError, PortOpenError
from cubestack.host.studies import demo

LONG = "cubestack emulate: sky.toml: " + "a message that takes several lines of a terminal, " * 5
SERVES = "CubeStar serves on out/ttyCUBESTAR at 57600 baud; Ctrl-C ends it"


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    lines: list[str] = []
    monkeypatch.setattr(demo, "say", lines.append)
    return lines


def emulator(*lines: str, port: Path) -> Callable[[object], object]:
    """An emulator that prints ``lines``; its port exists from `SERVES` on."""

    @contextmanager
    def emulating(_words: object) -> Iterator[Iterator[str]]:
        def talk() -> Iterator[str]:
            for line in lines:
                if line == SERVES:
                    port.touch()
                yield line

        yield talk()

    return emulating


def test_output_of_the_emulator_is_shown_in_full(
    monkeypatch: pytest.MonkeyPatch, said: list[str], tmp_path: Path
) -> None:
    port = tmp_path / "tty"
    monkeypatch.setattr(demo, "emulating", emulator("a warning", LONG, port=port))
    with pytest.raises(PortOpenError), demo._served(["cubestar"], port):
        pass
    assert said == ["starting the emulator", "a warning", LONG]
    said.clear()
    monkeypatch.setattr(demo, "emulating", emulator("starting: 5 s", SERVES, "more", port=port))
    with demo._served(["cubestar"], port) as served:
        assert served == port
    assert said == ["starting the emulator", "starting: 5 s", SERVES]
    monkeypatch.setattr(demo, "emulating", emulator(SERVES, "latch-up", LONG, port=port))
    with pytest.raises(PortClosedError), demo._served(["cubestar"], port):
        raise PortClosedError
    assert said[-1] == f"the emulator ended: {LONG}"

from pathlib import Path
from typing import Any

import pytest

from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.host.shell.language import ShellError
from cubestack.host.shell.names import check_count, to_number

from .conftest import CONTROLS, Known


@pytest.mark.parametrize(
    "line",
    [
        *("peek", "peek a b", "time 1 2", "scene", "scene a b", "dump x", "list a b"),
        *("read", "read a b c"),
        *("bench", "bench q s", "image", "image a.png b c", "watch", "watch a 1 2 3"),
    ],
)
def test_wrong_number_of_words_prints_the_usage(known: Known, line: str) -> None:
    name, *words = line.split()
    with pytest.raises(ShellError, match=f"^{name}: {len(words)} words; usage: {name}"):
        known.run(line)
    assert known.line.silences == known.letters.silences == []


@pytest.mark.parametrize("line", ["power SRAM1", "power SRAM1 on off", "power SRAM1 maybe"])
def test_power_command_rejects_other_words(known: Known, line: str) -> None:
    with pytest.raises(ShellError, match=r"usage: power \[CHANNEL on\|off\]"):
        known.run(line)
    known.controls.switch.assert_not_called()


@pytest.mark.parametrize(("word", "on"), [("on", True), ("off", False)])
def test_power_shows_the_currents(known: Known, word: str, on: bool) -> None:
    found = known.run(f"power SRAM1 {word}")
    known.controls.switch.assert_called_once_with("SRAM1", on)
    assert found.rows == [("total", "71.9 mA"), ("SRAM1", "0.2 mA")]
    assert found.data == {"currents_ma": {"total": 71.94, "SRAM1": 0.25}}
    assert known.run("power") == found


def test_time_advances_and_is_shown(known: Known) -> None:
    found = known.run("time 0.25")
    known.controls.advance.assert_called_once_with(0.25)
    assert (found.rows, found.data) == ([("time", "1.500000 s")], {"time_s": 1.5})
    assert known.run("time") == found
    known.controls.advance.assert_called_once_with(0.25)
    with pytest.raises(ShellError, match="time: must be 0 to 1000000000, not -1"):
        known.run("time -1")


def test_shell_scene_point_and_fault_commands_reach_the_controls(known: Known) -> None:
    assert known.run("scene a.toml").data == {"scene": "a.toml"}
    known.controls.scene.assert_called_once_with(Path("a.toml"))
    turned = known.run("point quaternion=0,0,0,1 sun=1,0,0")
    known.controls.point.assert_called_once_with(["quaternion=0,0,0,1", "sun=1,0,0"])
    assert turned.data == {"point": "quaternion=0,0,0,1 sun=1,0,0"}
    listed = known.run("fault")
    faults = CONTROLS["faults"]
    assert (listed.rows, listed.data) == ([("", one) for one in faults], {"faults": faults})
    log = known.run("fault log")
    assert log.rows == [("", "0.1 s latch-up SRAM1")]
    known.controls.fault.assert_not_called()
    done = known.run("fault latch-up SRAM1 for_s=2")
    known.controls.fault.assert_called_once_with(["latch-up", "SRAM1", "for_s=2"])
    assert done.data == {"fault": "latch-up SRAM1 for_s=2"}


def test_peek_prints_the_values_of_a_register(known: Known) -> None:
    found = known.run("peek TIMER0")
    known.controls.peek.assert_called_once_with("TIMER0")
    assert found.rows == [("TIMER0.CNT", "0x7"), ("x", "not there")]
    assert found.data == {"values": {"TIMER0.CNT": 7, "x": None}}


def test_raw_waits_briefly_for_more_bytes(known: Known) -> None:
    found = known.run("raw 1f7f 80 1fff")
    assert found.data["answer"].startswith("1f7f")
    assert found.rows == [("", bytes.fromhex(found.data["answer"]).hex(" "))]
    (waited_s,) = known.line.silences
    assert 0.1 <= waited_s <= 0.5
    assert known.run("raw 00").rows == [("", "(nothing)")]
    with pytest.raises(ShellError, match="usage: raw HEX"):
        known.run("raw")
    with pytest.raises(ShellError, match="'1 2 3' is not hexadecimal bytes"):
        known.run("raw 1 2 3")


def test_bench_shows_short_answers_and_counts_long_ones(known: Known) -> None:
    for letter in INTERFACE.service_port.letters:
        known.letters.answers[letter.letter] = b"x" * letter.length
        found = known.run(f"bench {letter.letter}")
        short = letter.length <= 8
        text = repr("x" * letter.length) if short else f"{letter.length} bytes"
        assert found.rows == [(letter.name, text)]
        assert found.data == {"letter": letter.letter, "answer": (b"x" * letter.length).hex()}
        known.letters.answers[letter.letter] = b"x" * (letter.length - 1)
        cut = known.run(f"bench {letter.letter}")
        assert cut.rows == [(letter.name, f"{letter.length - 1} bytes of {letter.length}")]


@pytest.mark.parametrize("word", ["é", "qq", "€"])
def test_bench_rejects_unknown_letters(known: Known, word: str) -> None:
    with pytest.raises(ShellError, match=f"no letter '{word}'; known: "):
        known.run(f"bench {word}")


@pytest.mark.parametrize(
    ("words", "pauses"), [("", [1.0] * 9), (" 3", [1.0] * 2), (" 3 0.25", [0.25] * 2), (" 1 9", [])]
)
def test_watch_repeats_with_its_interval(known: Known, words: str, pauses: list[float]) -> None:
    waited, shown = list[float](), list[Any]()
    node: Any = known.target.node
    node.pause = waited.append
    known.shell.on_row = shown.append
    found = known.run(f"watch Identification{words}")
    assert waited == pauses
    assert len(found.data["readings"]) == len(shown) == len(pauses) + 1


@pytest.mark.parametrize(("count", "good"), [(0, False), (1, True), (2, True), (3, False)])
def test_shell_rejects_too_few_or_too_many_words(count: int, good: bool) -> None:
    if good:
        check_count("do A [B]", ["x"] * count, 1, 2)
        return
    with pytest.raises(ShellError, match=rf"^do: {count} words; usage: do A \[B\]$"):
        check_count("do A [B]", ["x"] * count, 1, 2)


@pytest.mark.parametrize(
    ("text", "good"),
    [
        *((text, True) for text in ("2", "999999999", "1e9")),
        *((text, False) for text in ("1.99", "1.1e9", "x", "nan")),
    ],
)
def test_to_number_accepts_2_to_1e9(text: str, good: bool) -> None:
    if good:
        assert to_number("do", text, 2) == float(text)
        return
    with pytest.raises(ShellError, match="do: must be "):
        to_number("do", text, 2)

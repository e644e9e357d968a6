from dataclasses import dataclass

import pytest

from cubestack.firmware_model.interface.codec.field import InterfaceError
from cubestack.firmware_model.interface.codec.switch_messages import (
    apply_command,
    read_switches,
    shown_values,
    switch_messages,
    switch_parameters,
)
from cubestack.firmware_model.interface.codec.switches import DEFAULT_PROFILE, Switches, switch


@dataclass(frozen=True)
class Some(Switches):
    rounds: str = switch("how often", "1", "6", source="section 1", reason="fewer errors")
    limit: str = switch("how far", "42", "57", "60", source="section 2", reason="more pairs")


def test_profile_sets_every_switch_before_single_changes_apply() -> None:
    assert Some.of("published") == Some("1", "42")
    assert Some.of("extended") == Some("6", "57")
    assert Some() == Some.of() == Some.of(DEFAULT_PROFILE)
    assert Some.of("published", "limit=60,rounds=6") == Some("6", "60")
    assert list(Some.declared()) == ["rounds", "limit"]
    assert Some.declared()["limit"].choices == ("42", "57", "60")
    assert not Switches.declared()


def test_switches_report_their_profile() -> None:
    names = [Some.of("published").profile, Some.of("extended").profile, Some("1", "57").profile]
    assert names == ["published", "extended", "mixed"]


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (("best", ""), "profile must be one of published, extended, not 'best'"),
        (("published", "limit=61"), "switch limit must be one of 42, 57, 60, not '61'"),
        (("published", "limt=60"), "set: no switch 'limt'; switches: rounds, limit"),
        (("published", "limit"), "set: 'limit' is not SWITCH=VALUE; switches: rounds, limit"),
    ],
)
def test_rejects_unknown_names(given: tuple[str, str], text: str) -> None:
    with pytest.raises(ValueError, match=r"switch|profile|SWITCH") as refused:
        Some.of(*given)
    assert str(refused.value) == text


@dataclass(frozen=True)
class Own(Switches):
    lens: str = switch("", "ideal", "drawn", source="", reason="", hardware=True)
    star_limit: str = switch("", "3.8", "4", "all", source="", reason="")
    fit: str = switch("", "all", "some-of-them", source="", reason="")


SET_PROFILE, SET_SWITCH, SHOWN = switch_messages(Own, 100, 200, "kept")
PUBLISHED, EXTENDED = Own.of("published"), Own.of("extended")


def test_switch_message_accepts_only_values_of_that_switch() -> None:
    names = [[choice.name for choice in field.choices or ()] for field in SHOWN.fields]
    assert names[2:] == [["STAR_LIMIT_3_8", "STAR_LIMIT_4", "ALL"], ["ALL", "SOME_OF_THEM"]]
    assert [field.name for field in SHOWN.fields] == ["Profile", "Lens", "StarLimit", "Fit"]
    tried = [{"Switch": at, "Value": value} for at in range(5) for value in range(8)]
    good = [tuple(values.values()) for values in tried if not SET_SWITCH.violations(values)]
    assert good == [(1, 2), (1, 3), (1, 4), (2, 4), (2, 5)]
    assert [message.extension for message in (SET_PROFILE, SET_SWITCH, SHOWN)] == [True] * 3


@pytest.mark.parametrize("number", [2, 3, 255])
def test_unknown_profile_number_is_refused(number: int) -> None:
    assert SET_PROFILE.violations({"Profile": number})


def test_board_switch_is_shown_and_cannot_be_commanded() -> None:
    with pytest.raises(InterfaceError, match="no choice 'LENS'; known: STAR_LIMIT, FIT"):
        SET_SWITCH.pack(**switch_parameters("lens", "drawn"))
    with pytest.raises(InterfaceError, match="no choice 'NONSENSE'; known: STAR_LIMIT_3_8, "):
        SET_SWITCH.pack(**switch_parameters("fit", "nonsense"))
    changed = apply_command(PUBLISHED, "SetProfile", {"Profile": 1})
    assert changed == Own(lens="ideal", star_limit="4", fit="some-of-them")
    assert shown_values(changed) == {"Profile": 2, "Lens": 0, "StarLimit": 3, "Fit": 5}
    assert shown_values(EXTENDED)["Profile"] == 1


@pytest.mark.parametrize("switches", [PUBLISHED, EXTENDED, Own(lens="drawn", star_limit="all")])
def test_frame_shows_the_switches(switches: Own) -> None:
    values = SHOWN.unpack(SHOWN.pack(**shown_values(switches)))
    assert read_switches(Own, values) == switches
    with pytest.raises(ValueError, match="switch fit must be one of all, some-of-them, not '9'"):
        read_switches(Own, values | {"Fit": 9})


def test_set_switch_changes_one_switch() -> None:
    values = SET_SWITCH.unpack(SET_SWITCH.pack(**switch_parameters("star_limit", "all")))
    assert apply_command(PUBLISHED, "SetSwitch", values) == Own.of("published", "star_limit=all")

from dataclasses import dataclass

import pytest

from cubestack.firmware_model.interface.codec.switches import DEFAULT_PROFILE, Switches, switch


@dataclass(frozen=True)
class Some(Switches):
    rounds: str = switch("how often", "1", "6", source="section 1", reason="fewer errors")
    limit: str = switch("how far", "42", "57", "60", source="section 2", reason="more pairs")


def test_a_profile_sets_every_switch_and_changes_come_after_it() -> None:
    assert Some.of("published") == Some("1", "42")
    assert Some.of("extended") == Some("6", "57")
    assert Some() == Some.of() == Some.of(DEFAULT_PROFILE)
    assert Some.of("published", "limit=60,rounds=6") == Some("6", "60")
    assert list(Some.declared()) == ["rounds", "limit"]
    assert Some.declared()["limit"].choices == ("42", "57", "60")
    assert not Switches.declared()


def test_they_know_which_profile_they_are() -> None:
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

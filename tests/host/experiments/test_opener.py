"""What experiments power up: the options that go there, and nothing left open after an error."""

from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.faults.plan import Plan, load_plan
from cubestack.host.devices.registry import device
from cubestack.host.experiments import opener
from cubestack.host.experiments.opener import Opener

PLAN = "[[fault]]\nkind = 'uart-drop'\nat_s = 1.0\n"


class Emulated:
    """What stands for a powered-up device.

    Attributes:
        asked: how it was powered up.
        plans: those that were loaded.
        closed: how often it was.
        complaint: raised for any plan.
    """

    complaint: Exception | None = None

    def __init__(self, *given: Any, **options: Any) -> None:
        self.asked = given, options
        self.plans = list[Plan]()
        self.closed = 0
        self.faults = self

    def load(self, plan: Plan) -> None:
        if self.complaint is not None:
            raise self.complaint
        self.plans.append(plan)

    def close(self) -> None:
        self.closed += 1


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[Emulated]:
    """Devices that were powered up."""
    found = list[Emulated]()

    def power_up(*given: Any, **options: Any) -> Emulated:
        found.append(Emulated(*given, **options))
        return found[-1]

    monkeypatch.setattr(opener, "power_up", power_up)
    return found


@pytest.mark.parametrize(
    ("board", "rates"),
    [
        ({}, False),
        ({"profile": "published"}, False),
        ({"profile": "extended"}, True),
        ({"profile": "extended", "firmware": "a.elf"}, False),
        ({"firmware": "a.elf"}, False),
    ],
)
def test_only_our_own_firmware_of_today_rates_its_results(
    board: dict[str, Any], rates: bool
) -> None:
    assert Opener(device("cubestar"), board=board).rates is rates


def test_switches_are_those_of_the_profile_with_what_was_set() -> None:
    opened = Opener(device("cubestar"), board={"profile": "extended", "set": "voting=algorithm-2"})
    plain = Opener(device("cubestar"), board={"profile": "extended"})
    assert plain.switches == device("cubestar").switches.of("extended", "")
    assert opened.switches != plain.switches
    assert Opener(device("cubestar")).switches.profile == "published"


def test_options_of_the_experiment_come_before_those_of_the_user(made: list[Emulated]) -> None:
    told = list[Any]()
    opened = Opener(
        device("cubestar"), "reference", {"profile": "extended", "layout": "2"}, opened=told.append
    )
    emulated: Any = opened("a scene", seed=7, layout="3")
    assert emulated.asked == (
        (device("cubestar"), "a scene"),
        {"seed": 7, "engine": "reference", "profile": "extended", "layout": "3"},
    )
    assert told == made == [emulated]
    assert (emulated.plans, emulated.closed) == ([], 0)


@pytest.mark.parametrize("in_a_file", [True, False])
def test_a_plan_is_loaded(made: list[Emulated], tmp_path: Path, in_a_file: bool) -> None:
    path = tmp_path / "plan.toml"
    path.write_text(PLAN, "utf-8")
    Opener(device("cubestar"))(None, seed=0, faults=path if in_a_file else load_plan(path))
    assert [len(plan.faults) for plan in made[0].plans] == [1]


def test_a_plan_that_makes_no_sense_leaves_nothing_open(
    made: list[Emulated], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "plan.toml"
    path.write_text(PLAN, "utf-8")
    monkeypatch.setattr(Emulated, "complaint", ValueError("no such thing"))
    with pytest.raises(ValueError, match="no such thing"):
        Opener(device("cubestar"))(None, seed=0, faults=path)
    assert made[0].closed == 1


@pytest.mark.parametrize("error", [ValueError, OSError])
def test_who_can_not_look_at_it_leaves_nothing_open(
    made: list[Emulated], error: type[Exception]
) -> None:
    def look(_emulated: object) -> None:
        raise error("no file")

    with pytest.raises(error, match="no file"):
        Opener(device("cubestar"), opened=look)(None, seed=0)
    assert made[0].closed == 1

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.host.studies.rows import trial
from cubestack.host.studies.rows.trial import Figures, measured, measured_in_turn


@pytest.fixture(autouse=True)
def calls(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """Calls of an experiment whose results are its arguments."""
    made: list[dict[str, Any]] = []

    def measure(device: str, **how: Any) -> list[dict[str, Any]]:
        made.append({"device": device, **how})
        return [made[-1]] * how["frames"]

    monkeypatch.setattr(trial, "measure", measure)
    return made


def total(results: Sequence[Any]) -> Figures:
    return {"sum": float(sum(one["speed"] for one in results))}


OPENED = SimpleNamespace(board={"profile": "extended"})


def test_runs_in_turn_prefix_their_figures(calls: list[dict[str, Any]]) -> None:
    runs = {"slow": {"speed": 1}, "fast": {"speed": 5}}
    made = measured_in_turn("walker", total, runs, 4, units=2, extremes=("sum",))
    assert made.run(OPENED, 4) == {"slow sum": 4, "fast sum": 20}
    assert [(one["speed"], one["seed"], one["frames"]) for one in calls] == [
        *((1, 1, 2), (1, 2, 2), (5, 1, 2), (5, 2, 2))
    ]
    assert all(one["profile"] == "extended" for one in calls)


def test_call_names_the_options_of_each_run() -> None:
    made = [
        measured_in_turn("walker", total, {"slow": {"speed": speed}}, 4).call for speed in (1, 2)
    ]
    assert "slow=speed=1" in made[0]
    assert made[0] != made[1]


def test_a_single_profile_is_no_option() -> None:
    made = measured("walker", total, 4, profile="extended", speed=1)
    assert (made.profile, made.command) == (
        "extended",
        "measure walker --frames 4 --seed 1 --speed 1",
    )

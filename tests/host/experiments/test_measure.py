import argparse
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import pytest

from cubestack.firmware_model.values import REQUIRED, choice, many, number, whole
from cubestack.host.cli.arguments import add_options, chosen
from cubestack.host.devices.experiment import Experiment, Result
from cubestack.host.devices.registry import device, devices
from cubestack.host.errors import TargetError
from cubestack.host.experiments import measure as measuring
from cubestack.host.experiments.facts import fact_lines
from cubestack.host.experiments.measure import measure
from cubestack.host.options import Options, corner, switch


@dataclass(frozen=True, kw_only=True)
class Wanted(Options):
    frames: int = whole(1, "number of frames", 1, 9)
    corner: tuple[int, int] = corner((0, 0), "part")
    tilt: float | None = number(None, "largest tilt", 0, 180, "deg")
    way: str = choice("up", "where to", ("up", "down"))
    skip: tuple[str, ...] = many((), "left out", choice(REQUIRED, "", ("a", "b")))
    quick: bool = switch("be quick")
    left: int | None = whole(None, "one side", 0, group="side")
    right: int | None = whole(None, "the other", 0, group="side")

    def check(self) -> None:
        if self.quick and self.given("tilt"):
            raise ValueError("--tilt takes its time")


@dataclass(frozen=True)
class Number(Result):
    number: int


class Counting(Experiment[Any, Wanted, Number]):
    options = Wanted
    description = "Counts."
    decides = ("layout",)

    def count(self, options: Wanted) -> int:
        return options.frames

    def run(self, opened: Any, options: Wanted) -> Iterator[Number]:
        yield from map(Number, range(options.frames))

    def summarise(self, results: Sequence[Number], wall_s: float) -> Iterable[str]:
        return fact_lines({"results": len(results)})


@pytest.fixture
def counting(monkeypatch: pytest.MonkeyPatch) -> None:
    counted = replace(device("cubestar"), experiment=Counting)
    monkeypatch.setattr(measuring, "registered", lambda _name: counted)


@pytest.mark.usefixtures("counting")
def test_results_are_yielded_one_by_one_with_progress() -> None:
    told: list[tuple[int, int]] = []
    results = measure("cubestar", frames=3, progress=lambda *done: told.append(done))
    assert told == []
    assert next(results).as_dict() == {"number": 0}
    assert told == [(1, 3)]
    assert [result.as_dict()["number"] for result in results] == [1, 2]
    assert told == [(1, 3), (2, 3), (3, 3)]


@pytest.mark.usefixtures("counting")
@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        ({"frame": 3}, "no option 'frame' for cubestar; known: frames, corner, tilt"),
        ({"layout": "2"}, "no option 'layout'"),  # the experiment's own decision
        ({"frames": "0"}, "frames must be 1 to 9, not 0"),
        ({"corner": (1, 2, 3)}, r"corner must be a list of 2 numbers, not \(1, 2, 3\)"),
        ({"skip": ("a", "c")}, "skip must be one of a, b, not 'c'"),
        ({"left": 0, "right": 1}, "--left and --right exclude each other"),
        ({"quick": True, "tilt": 1}, "--tilt takes its time"),
    ],
)
def test_rejects_invalid_options_before_it_starts(options: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        measure("cubestar", **options)


def test_board_options_are_checked() -> None:
    with pytest.raises(ValueError, match="layout of cubestar must be one of 1, 2, 3, two-boards"):
        measure("cubestar", layout="4")
    with pytest.raises(ValueError, match="no option 'layout' for cubesense"):
        measure("cubesense", layout="2")


def test_rejects_unknown_devices_and_devices_without_experiment(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with pytest.raises(TargetError, match="no device 'cubestarr'; known: cubestar"):
        measure("cubestarr")
    silent = replace(device("cubestar"), experiment=None)
    monkeypatch.setattr(measuring, "registered", lambda _name: silent)
    with pytest.raises(ValueError, match="no experiment for cubestar"):
        measure("cubestar")


def parse(*arguments: str) -> Wanted:
    parser = argparse.ArgumentParser()
    add_options(parser, Wanted)
    return chosen(parser.parse_args(arguments), Wanted)


def test_command_line_and_keywords_give_the_same_options() -> None:
    assert parse() == Wanted()
    assert parse("--frames", "3", "--corner", "0,256", "--tilt", "5") == Wanted(
        frames=3, corner=(0, 256), tilt=5.0
    )
    assert parse("--skip", "a", "--skip", "b", "--quick") == Wanted(skip=("a", "b"), quick=True)
    assert Wanted(corner="0,256", frames="3") == Wanted(corner=(0, 256), frames=3)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("--frames", "0"), "argument --frames: must be 1 to 9, not 0"),
        (("--left", "0", "--right", "1"), "not allowed with argument --left"),
        (("--way", "left"), "argument --way: must be one of up, down, not 'left'"),
    ],
)
def test_command_line_rejects_invalid_arguments(
    arguments: tuple[str, ...], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        parse(*arguments)
    assert complaint in capsys.readouterr().err


@pytest.mark.parametrize("name", [one.name for one in devices()])
def test_every_declared_study_loads(name: str) -> None:
    one = device(name)
    assert one.experiment is not None
    assert callable(one.study("demo"))
    experiments = [one.experiment(), *(report.load() for report in one.reports)]
    for experiment in experiments:
        assert experiment.options().declared()["seed"] if experiment.powers_up else True
        assert experiment.count(experiment.options()) >= 1
        assert set(experiment.decides) <= {option.name for option in one.all_options}
    assert one.study("bench").figures

from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.emulator.faults.plan import Plan, load_plan
from cubestack.host.devices.registry import device
from cubestack.host.experiments import opener
from cubestack.host.experiments.opener import MeasureOptions, Opener
from cubestack.host.experiments.scene_experiment import SceneExperiment


class Emulated:
    """A powered-up device; ``complaint`` is raised for any fault plan."""

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
def test_only_the_extended_profile_rates_its_results(board: dict[str, Any], rates: bool) -> None:
    assert Opener(device("cubestar"), board=board).rates is rates


def test_set_changes_switches_of_the_profile() -> None:
    opened = Opener(device("cubestar"), board={"profile": "extended", "set": "voting=algorithm-2"})
    plain = Opener(device("cubestar"), board={"profile": "extended"})
    assert plain.switches == device("cubestar").switches.of("extended", "")
    assert opened.switches != plain.switches
    assert Opener(device("cubestar")).switches.profile == "published"


def test_experiment_options_override_user_options(made: list[Emulated]) -> None:
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


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A fault plan."""
    path = tmp_path / "plan.toml"
    path.write_text("[[fault]]\nkind = 'uart-drop'\nat_s = 1.0\n", "utf-8")
    return path


@pytest.mark.parametrize("in_a_file", [True, False])
def test_loads_a_fault_plan(made: list[Emulated], path: Path, in_a_file: bool) -> None:
    Opener(device("cubestar"))(None, seed=0, faults=path if in_a_file else load_plan(path))
    assert [len(plan.faults) for plan in made[0].plans] == [1]


def test_invalid_plan_closes_the_device(
    made: list[Emulated], path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Emulated, "complaint", ValueError("no such thing"))
    with pytest.raises(ValueError, match="no such thing"):
        Opener(device("cubestar"))(None, seed=0, faults=path)
    assert made[0].closed == 1


@pytest.mark.parametrize("error", [ValueError, OSError])
def test_failing_callback_closes_the_device(made: list[Emulated], error: type[Exception]) -> None:
    def look(_emulated: object) -> None:
        raise error("no file")

    with pytest.raises(error, match="no file"):
        Opener(device("cubestar"), opened=look)(None, seed=0)
    assert made[0].closed == 1


COLUMNS = ("found_deg", "error_deg", "right")


def measure(device: Any) -> tuple[float | None, float | None, bool]:
    found = device.scene - 0.5 if device.scene < 9 else None
    return found, None if found is None else found - device.scene, found is not None


def opened(scene: Any, **_options: Any) -> Any:
    """Powers up a stub of a device."""
    return nullcontext(SimpleNamespace(scene=scene))


def experiment(columns: tuple[str, ...] = COLUMNS) -> SceneExperiment:
    scenes = iter([1.0, 2.0, 9.0])
    return SceneExperiment(__doc__, lambda _rng, _options: next(scenes), measure, columns)


def test_each_frame_has_its_own_scene() -> None:
    results = list(experiment().run(opened, MeasureOptions(frames=3)))
    assert [result.as_dict() for result in results] == [
        {"found_deg": 0.5, "error_deg": -0.5, "right": True},
        {"found_deg": 1.5, "error_deg": -0.5, "right": True},
        {"found_deg": None, "error_deg": None, "right": False},
    ]


def test_scene_experiment_prints_table_and_summary() -> None:
    one = experiment()
    results = list(one.run(opened, MeasureOptions(frames=3)))
    assert one.columns == ("found deg", "error deg", "right")
    assert [one.row(number, result) for number, result in enumerate(results)] == [
        ("0.5", "-0.5", "True"),
        ("1.5", "-0.5", "True"),
        ("-", "-", "False"),
    ]
    lines = [" ".join(line.split()) for line in one.summarise(results, 1.0)]
    assert lines == ["results 3", "largest error deg 0.5", "rms error deg 0.5", "right 2"]


def test_measure_must_return_a_value_for_each_column() -> None:
    with pytest.raises(ValueError, match="measure must return found_deg, not 3 values"):
        next(experiment(("found_deg",)).run(opened, MeasureOptions()))

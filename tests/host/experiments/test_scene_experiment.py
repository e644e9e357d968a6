from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.host.experiments.opener import MeasureOptions
from cubestack.host.experiments.scene_experiment import SceneExperiment

COLUMNS = ("found_deg", "error_deg", "right")


def measure(device: Any) -> tuple[float | None, float | None, bool]:
    found = device.scene - 0.5 if device.scene < 9 else None
    return found, None if found is None else found - device.scene, found is not None


class Opened(SimpleNamespace):
    """A stub of an opener and its device."""

    def __call__(self, scene: Any, **_options: Any) -> "Opened":
        self.scene = scene
        return self

    def __enter__(self) -> "Opened":
        return self

    def __exit__(self, *_error: object) -> None: ...


def experiment(columns: tuple[str, ...] = COLUMNS) -> SceneExperiment:
    scenes = iter([1.0, 2.0, 9.0])
    return SceneExperiment(__doc__, lambda _rng, _options: next(scenes), measure, columns)


def test_each_frame_has_its_own_scene() -> None:
    results = list(experiment().run(Opened(), MeasureOptions(frames=3)))
    assert [result.as_dict() for result in results] == [
        {"found_deg": 0.5, "error_deg": -0.5, "right": True},
        {"found_deg": 1.5, "error_deg": -0.5, "right": True},
        {"found_deg": None, "error_deg": None, "right": False},
    ]


def test_table_and_summary() -> None:
    one = experiment()
    results = list(one.run(Opened(), MeasureOptions(frames=3)))
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
        next(experiment(("found_deg",)).run(Opened(), MeasureOptions()))

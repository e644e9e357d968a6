from types import SimpleNamespace
from typing import Any

from cubestack.host.studies.upsets.figures import FEW, upset_figures
from cubestack.host.studies.upsets.sample import UpsetResult


class Experiment:
    """Upsets of two bits: one that is seen in odd scenes, one without effect."""

    def __init__(self) -> None:
        self.asked: list[dict[str, Any]] = []

    def options(self, **given: Any) -> SimpleNamespace:
        self.asked.append(given)
        return SimpleNamespace(**given)

    def run(self, _opened: object, options: Any) -> list[UpsetResult]:
        odd = options.seed % 2
        about = ({"storing": 1.0}, 1.0, 1, 1e-3)
        return [
            UpsetResult(
                *("writer.ack", 0, False, "storing", 0.5, "picture" if odd else "nothing"),
                *("wrong" if odd else "right", "", 1, *about),
            ),
            UpsetResult("writer.data", 0, False, "storing", 0.5, "nothing", "right", "", 0, *about),
        ]


def test_each_scene_has_each_bit_once() -> None:
    experiment: Any = Experiment()
    found = upset_figures(None, 4, experiment=experiment)
    assert experiment.asked == [{"frames": 1, "seed": seed} for seed in range(4)]
    assert (found["writer.ack upsets"], found["writer.ack bits"]) == (4, 1)
    assert (found["writer.ack seen"], found["writer.ack wrong"]) == (50, 50)
    assert found["writer.data seen"] == 0
    assert (found["all upsets"], found["all picture"], found["all nothing"]) == (8, 2, 6)
    assert found["all wrong"] == 25
    assert found["all a day"] == found["writer.ack a day"] == 0.5e-3


def test_without_scenes_a_few_registers_show_what_runs() -> None:
    experiment: Any = Experiment()
    upset_figures(None, 0, experiment=experiment)
    assert experiment.asked == [{"frames": 1, "seed": 0, "registers": FEW}]

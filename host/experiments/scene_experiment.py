"""An experiment of two functions: one chooses a scene, the other measures it."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from cubestack.host.devices.experiment import Experiment, Result
from cubestack.host.emulation.emulated import AnyEmulated
from cubestack.host.experiments.facts import fact_lines
from cubestack.host.experiments.opener import MeasureOptions, Opener


class NamedResult(Result):
    """A result whose attributes are the values of the columns."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        vars(self).update(values)


class SceneExperiment(Experiment[Opener[Any, Any], Any, NamedResult]):
    """Measures random scenes, or that of --scene, one after the other with one device.

    Results have the columns as attributes; a column "right" (true, false, or None without a truth)
    lets `--min-right` judge them, and columns that begin with "error" are summed up.
    """

    def __init__(
        self,
        description: str | None,
        random_scene: Callable[[np.random.Generator, Any], Any],
        measure: Callable[[Any], Iterable[Any]],
        columns: Sequence[str],
        *,
        title: str = "over the serial line, beside the truth",
        options: type[MeasureOptions] = MeasureOptions,
    ) -> None:
        """Declare it.

        Args:
            description: the help, with examples.
            random_scene: returns a scene, given a source of random numbers and the options.
            measure: returns the values of the columns, given the powered-up device.
            columns: their names in JSON, units included: "truth_lux".
            title: of the table of results.
            options: what can be chosen.
        """
        self.description = description or ""
        self.options = options
        self.title = title
        self.names = tuple(columns)
        self.columns = tuple(name.replace("_", " ") for name in columns)
        self._random_scene = random_scene
        self._measure = measure

    def count(self, options: MeasureOptions) -> int:
        return options.frames

    def run(self, opened: Opener[Any, Any], options: MeasureOptions) -> Iterator[NamedResult]:
        given = None if options.scene is None else opened.device.scene(options.scene)
        rng = np.random.default_rng(options.seed)
        with opened(given, seed=options.seed, faults=options.faults) as emulated:
            for _ in range(options.frames):
                emulated.scene = self._random_scene(rng, options) if given is None else given
                yield NamedResult(self._values(emulated))

    def _values(self, emulated: AnyEmulated) -> dict[str, Any]:
        values = tuple(self._measure(emulated))
        if len(values) != len(self.names):
            wanted = ", ".join(self.names)
            raise ValueError(f"measure must return {wanted}, not {len(values)} values: {values}")
        return dict(zip(self.names, values, strict=True))

    def row(self, number: int, result: NamedResult) -> tuple[str, ...]:
        return tuple(map(_cell, result.as_dict().values()))

    def summarise(self, results: Sequence[NamedResult], wall_s: float) -> Iterable[str]:
        facts: dict[str, Any] = {"results": len(results)}
        for name in (name for name in self.names if name.startswith("error")):
            given = (vars(result)[name] for result in results)
            errors = [abs(error) for error in given if error is not None]
            if errors:
                facts[f"largest {name}"] = _cell(max(errors))
                facts[f"rms {name}"] = _cell(float(np.sqrt(np.mean(np.square(errors)))))
        if "right" in self.names:
            facts["right"] = sum(result.as_dict()["right"] is True for result in results)
        return fact_lines(facts)


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.5g}" if isinstance(value, float) else str(value)

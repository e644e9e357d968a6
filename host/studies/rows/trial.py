"""An experiment that yields figures, and its repeatable description."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from cubestack.host.devices.experiment import Result
from cubestack.host.experiments.measure import measure
from cubestack.host.experiments.opener import Opener
from cubestack.host.options import option_string
from cubestack.host.studies.rows.estimate import resampled

Figures = Mapping[str, float]


@dataclass(frozen=True)
class Trial:
    """An experiment for the figures of one or more rows."""

    #: figures by name, of (opened, frames); nan for a missing one. ``opened`` is an
    #: ``experiments.opener.Opener`` of the device in one profile
    run: Callable[[Any, int], Figures]
    frames: int = 0  #: of a whole run; 0 if it needs none
    quick: int = 0  #: of a quick one
    seconds: float = 1.0  #: wall time of a whole run in one profile, roughly, on one core
    #: arguments of `cubestack` that show it; empty if only `fidelity DEVICE --rows KEY` does
    command: str = ""
    profiles: bool = True  #: whether the profile matters
    profile: str = ""  #: the only one of interest, if so

    @property
    def call(self) -> str:
        """What is called, with all arguments."""
        return (
            f"{_described(self.run)}, {self.frames} frames"
            if self.frames
            else (_described(self.run))
        )


def _described(value: object) -> str:
    if isinstance(value, partial):
        given = [f"{name}={_described(one)}" for name, one in sorted(value.keywords.items())]
        return f"{_described(value.func)}({', '.join(given)})"
    if isinstance(value, dict):
        return ", ".join(f"{name}={_described(one)}" for name, one in value.items())
    name = getattr(value, "__qualname__", "") or repr(value)
    # A text with an address is another in each process.
    return type(value).__name__ if " at 0x" in name else name


def measured(
    device: str,
    summary: Callable[[Sequence[Any]], Figures],
    frames: int,
    quick: int = 2,
    seconds: float = 10.0,
    seed: int = 1,
    units: int = 1,
    extremes: tuple[str, ...] = (),
    profile: str = "",
    **options: Any,
) -> Trial:
    """A trial of `cubestack measure`: ``summary`` computes figures of its results.

    ``units`` is the number of devices for the frames, with seeds from ``seed`` on. With several, no
    single command repeats it, and `cubestack fidelity` shows the rows. ``extremes`` are beginnings
    of the names of figures that have no limits.
    """
    how = {"device": device, "summary": summary, "seed": seed, "units": units}
    run = partial(_measured, **how, extremes=extremes, options=options)  # type: ignore[arg-type]
    if units > 1:
        return Trial(run, frames, quick, seconds, profile=profile)
    words = ["measure", device, "--frames", str(frames), "--seed", str(seed)]
    for name, value in options.items():
        words += [option_string(name)] if value is True else [option_string(name), str(value)]
    return Trial(run, frames, quick, seconds, " ".join(words), profile=profile)


def measured_in_turn(
    device: str,
    summary: Callable[[Sequence[Any]], Figures],
    runs: Mapping[str, Mapping[str, Any]],
    frames: int,
    quick: int = 2,
    seconds: float = 10.0,
    seed: int = 1,
    units: int = 1,
    extremes: tuple[str, ...] = (),
    profile: str = "",
) -> Trial:
    """A trial of several runs of `cubestack measure`, by name, with the options of each; the names
    of their figures begin with the run's and a blank. Other arguments as in ``measured``."""
    how = {"device": device, "summary": summary, "seed": seed, "units": units}
    run = partial(_in_turn, **how, extremes=extremes, runs=runs)  # type: ignore[arg-type]
    return Trial(run, frames, quick, seconds, profile=profile)


def _in_turn(
    opened: Opener[Any, Any], frames: int, *, runs: Mapping[str, Mapping[str, Any]], **how: Any
) -> Figures:
    figures: dict[str, float] = {}
    for name, options in runs.items():
        found = _measured(opened, frames, options=options, **how)
        figures |= {f"{name} {key}": value for key, value in found.items()}
    return figures


def _measured(
    opened: Opener[Any, Any],
    frames: int,
    *,
    device: str,
    summary: Callable[[Sequence[Any]], Figures],
    seed: int,
    units: int,
    extremes: tuple[str, ...],
    options: Mapping[str, Any],
) -> Figures:
    used = min(units, max(1, frames // units))
    groups: list[list[Result]] = []
    for number in range(seed, seed + used):
        each: dict[str, Any] = {"frames": frames // used, "seed": number}
        found = list(measure(device, **each, **opened.board, **options))
        groups += [found] if units > 1 else [[one] for one in found]
    return resampled(summary, groups, extremes)

"""A campaign's plan: a TOML file, and its blocks of frames.

The file has ``device``, ``frames``, ``seed`` and, if wanted, the ``version`` of the format, and
three tables of options of `cubestack measure DEVICE`, or of another ``command``: ``[options]`` for
all frames, ``[grid]`` with lists of which every combination is a point, and ``[random]`` with what
is drawn anew for each block (docs/how-to/campaigns.md has an example).

All points use the same skies and the same drawn values, so that they differ only by their options.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib import resources
from itertools import product
from math import prod
from pathlib import Path
from typing import Any, Self

import numpy as np

from cubestack.firmware_model.formats.untrusted import read_text, read_toml
from cubestack.firmware_model.values import REQUIRED, whole
from cubestack.firmware_model.versions import CAMPAIGN_PLAN
from cubestack.hdl.user.source import rebased
from cubestack.host.devices.registry import device as registered
from cubestack.host.devices.registry import devices
from cubestack.host.experiments.measure import MEASURE, board_options, experiment_of, measure
from cubestack.host.options import Options

FRAMES = 100
"""Frames per block: a device is powered up, and its threshold searched, once per block."""

MOST_FRAMES, MOST_POINTS = 100_000_000, 100_000
"""Of a point, and of the grid."""

DECIDED = ("frames", "seed")
"""Options of `measure` that the plan sets."""

Values = Mapping[str, Any]


@dataclass(frozen=True)
class FrameBlock:
    """Frames that one worker measures in sequence; the result depends on nothing else."""

    number: int  #: counts from 0 through the campaign
    device: str  #: name
    options: Values  #: of the command, with what is swept
    swept: Values  #: those of them that differ between blocks
    frames: int  #: how many
    seed: int  #: of the first one
    command: str = MEASURE  #: what measures it


@dataclass(frozen=True, kw_only=True)
class CampaignPlan(Options):
    """A campaign; attributes are keys of its file."""

    device: str  #: what is measured
    frames: int = whole(REQUIRED, "at each point of the grid", 1, MOST_FRAMES)
    #: `measure`, or another one of the device that takes ``frames`` and ``seed``
    command: str = MEASURE
    seed: int = whole(0, "of everything random", 0)
    block: int = whole(FRAMES, "frames for which the device is powered up once", 1, MOST_FRAMES)
    options: Values = field(default_factory=dict)  #: of the command, for all frames
    #: values of options; every combination is measured
    grid: Mapping[str, list[Any]] = field(default_factory=dict)
    #: options drawn anew for each block: uniform from ``low`` to ``high``, or one ``of``
    random: Mapping[str, Values] = field(default_factory=dict)

    def check(self) -> None:
        """Raise ValueError, with the key, for an invalid plan."""
        for name in ("options", "grid", "random"):
            if not isinstance(getattr(self, name), dict):
                raise ValueError(f"{name} must be a table of options")
        for name, values in self.grid.items():
            if not isinstance(values, list) or not values:
                raise ValueError(f"grid.{name} must be a list of values, not {values!r}")
        if prod(map(len, self.grid.values())) > MOST_POINTS:
            raise ValueError(f"grid must have at most {MOST_POINTS} points")
        for name, draw in self.random.items():
            _check_draw(name, draw)
        given = [*self.options, *self.grid, *self.random]
        for name in given:
            if name in DECIDED:
                raise ValueError(f"{name} belongs at the top of a plan, not in options")
            if given.count(name) > 1:
                raise ValueError(f"{name} is given in two of options, grid and random")
        for block in self.blocks():
            try:
                measure(block.device, command=self.command, frames=1, seed=0, **block.options)
            except ValueError as error:
                raise ValueError(_where(block, str(error))) from None

    @classmethod
    def read(cls, path: Path) -> Self:
        """The plan of a TOML file; paths in it start at its folder.

        Raises:
            ValueError: names the file, and what is wrong with it.
            OSError: it can not be read.
        """
        try:
            table = read_toml(path)
            CAMPAIGN_PLAN.check(table.pop("version", None))
            known = list(cls.__dataclass_fields__)
            for key in table:
                if key not in known:
                    raise ValueError(f"no key {key!r} here; known: {', '.join(known)}")
            for key in ("device", "frames"):
                if key not in table:
                    raise ValueError(f"{key} is missing")
            return cls(**_with_paths(table, path.parent))
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None

    def as_dict(self) -> dict[str, Any]:
        """As JSON; ``Plan(**...)`` restores it."""
        return dict(vars(self))

    @property
    def points(self) -> list[dict[str, Any]]:
        return [
            dict(zip(self.grid, values, strict=True)) for values in product(*self.grid.values())
        ]

    def blocks(self) -> Iterator[FrameBlock]:
        at_a_point = -(-self.frames // self.block)
        for where, point in enumerate(self.points):
            for index in range(at_a_point):
                frames = min(self.block, self.frames - index * self.block)
                seed, drawn = self._drawn(index)
                swept = point | drawn
                options = dict(self.options) | swept
                number = where * at_a_point + index
                what = options, swept, frames, seed, self.command
                yield FrameBlock(number, self.device, *what)

    def _drawn(self, index: int) -> tuple[int, dict[str, Any]]:
        generator = np.random.default_rng([self.seed, index])
        seed = int(generator.integers(1 << 31))
        drawn: dict[str, Any] = {}
        for name, draw in self.random.items():
            if "of" in draw:
                drawn[name] = draw["of"][int(generator.integers(len(draw["of"])))]
            else:
                drawn[name] = float(generator.uniform(draw["low"], draw["high"]))
        return seed, drawn


def _check_draw(name: str, draw: Any) -> None:
    right = isinstance(draw, dict) and (
        (set(draw) == {"of"} and isinstance(draw["of"], list) and bool(draw["of"]))
        or (
            set(draw) == {"low", "high"}
            and all(isinstance(value, int | float) for value in draw.values())
            and draw["low"] <= draw["high"]
        )
    )
    if not right:
        raise ValueError(
            f"random.{name} must be {{ low = A, high = B }} or {{ of = [A, B] }}, not {draw!r}"
        )


def _where(block: FrameBlock, error: str) -> str:
    swept = ", ".join(f"{name} = {value!r}" for name, value in block.swept.items())
    return f"{error} (with {swept})" if swept else error


def _with_paths(table: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The table with paths of files relative to the plan's folder."""
    device = registered(table["device"])
    experiment = experiment_of(device, table.get("command", MEASURE))
    files = {
        name
        for name, declared in experiment.options.declared().items()
        if declared.metavar == "FILE"
    }
    files |= {
        name for name, one in board_options(device, experiment).items() if one.metavar == "FILE"
    }

    def told(name: str, value: Any) -> Any:
        if name == "gateware" and isinstance(value, str):
            return rebased(value, folder)
        return str(folder / value) if name in files and isinstance(value, str) else value

    changed = dict(table)
    if isinstance(table.get("options"), dict):
        changed["options"] = {name: told(name, value) for name, value in table["options"].items()}
    if isinstance(table.get("grid"), dict):
        changed["grid"] = {
            name: [told(name, value) for value in values] if isinstance(values, list) else values
            for name, values in table["grid"].items()
        }
    return changed


FOLDER = "campaigns"
SUFFIX = ".toml"


def known_plans() -> dict[str, Path]:
    folders = (
        resources.files(package).joinpath(FOLDER)
        for device in devices()
        if (package := device.study("campaign"))
    )
    files = (Path(str(file)) for folder in folders for file in folder.iterdir())
    return {file.stem: file for file in sorted(files) if file.suffix == SUFFIX}


def summary(path: Path) -> str:
    """A plan's purpose: the comment on its first line."""
    first, _, _ = read_text(path).partition("\n")
    return first.removeprefix("#").strip() if first.startswith("#") else ""


def plan_file(given: str) -> Path:
    """The file of a path, or of the name of a shipped plan.

    Raises ValueError if it is neither.
    """
    path, known = Path(given), known_plans()
    if given in known and not path.exists():
        return known[given]
    if path.suffix != SUFFIX and not path.exists():
        names = ", ".join(known)
        raise ValueError(f"no plan is called {given!r}: give a {SUFFIX} file, or one of {names}")
    return path

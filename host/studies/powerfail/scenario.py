"""A scenario of power cuts: commands to a device, and questions about what it remembers."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Self

from cubestack.emulator.iss.brown_out import FALLING_V, SUPPLY_V, dip_of
from cubestack.firmware_model.formats.untrusted import read_toml
from cubestack.firmware_model.values import (
    REQUIRED,
    TABLE,
    DeclaredValues,
    declare,
    many,
    number,
    positive,
    read_table,
    table,
    text,
    vector,
    whole,
)
from cubestack.firmware_model.versions import POWERFAIL_SCENARIO


class ScenarioError(ValueError):
    """A scenario that cannot be used; the text is one line."""


@dataclass(frozen=True, kw_only=True)
class Question(DeclaredValues):
    """What the device is asked after a power-up."""

    error = ScenarioError

    name: str = text(REQUIRED, "name of what the device remembers")
    send: str = text("", "text to send; each character is a byte", instead=("telemetry",))
    end: str = text("\n", "text at the end of the answer")
    telemetry: str = text(
        "", "telemetry frame to read, and its fields: 'Frame Field Field'", instead=("send",)
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        _one_of(self, "send", "telemetry")


@dataclass(frozen=True, kw_only=True)
class Step(DeclaredValues):
    """A command to the device, after whose answer it must remember something."""

    error = ScenarioError

    send: str = text("", "text to send; each character is a byte", instead=("telecommand",))
    answer: str = text("", "text that the device sends when it has obeyed")
    refused: str = text("", "text that the device sends instead if it cannot obey")
    telecommand: str = text(
        "", "telecommand and its parameters, as the shell takes them", instead=("send",)
    )
    settle_s: float = number(0.0, "time from the answer until it must be remembered", 0)
    state: Mapping[str, str] | None = declare(
        TABLE, None, "answers to questions after a power-up, by name; those left out are learned"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        _one_of(self, "send", "telecommand")
        if self.send and not self.answer:
            raise ScenarioError("a step with send needs an answer")


def _one_of(one: DeclaredValues, *names: str) -> None:
    if sum(bool(getattr(one, name)) for name in names) != 1:
        raise ScenarioError(f"needs either {' or '.join(names)}")


@dataclass(frozen=True, kw_only=True)
class BrownOut(DeclaredValues):
    """A dip of the supply."""

    error = ScenarioError

    curve: tuple[tuple[float, float], ...] = many(
        REQUIRED,
        "time in ms and supply in V of each corner, straight between them",
        vector(2, REQUIRED, ""),
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.curve) < 2 or any(a[0] >= b[0] for a, b in pairwise(self.curve)):
            raise ScenarioError("curve must have two corners or more, at rising times")
        if any(not 0 <= volts <= SUPPLY_V[1] for _, volts in self.curve):
            raise ScenarioError(f"curve must stay between 0 and {SUPPLY_V[1]} V")
        if dip_of(self.curve) is None:
            raise ScenarioError(f"curve never falls below {FALLING_V} V, where the part resets")


@dataclass(frozen=True, kw_only=True)
class Scenario(DeclaredValues):
    """A scenario; attributes are keys of its file."""

    error = ScenarioError

    device: str = text(REQUIRED, "device whose board runs the program")
    options: Mapping[str, str] | None = declare(
        TABLE, None, "further options of its board, as keywords of open_device"
    )
    line: str = text("", "serial line; by default the device's first one")
    seed: int = whole(0, "seed of everything random", 0)
    ready: str = text("", "text that the device sends when it has started")
    boot_s: float = positive(0.05, "time to start; with ready the longest one", unit="s")
    timeout_s: float = positive(0.5, "longest wait for an answer")
    torn: int = whole(3, "cuts in the middle of each operation", 0)
    between: int = whole(0, "cuts at random instructions between two operations", 0)
    second: int = whole(4, "most second cuts for each case, while it recovers", 0)
    worn: int = whole(1, "cases with worn cells for each erased page", 0)
    question: tuple[Question, ...] = table(
        REQUIRED, "what the device is asked after a power-up", Question, array=True
    )
    step: tuple[Step, ...] = table(REQUIRED, "commands to the device, in order", Step, array=True)
    brown_out: tuple[BrownOut, ...] = table(
        (), "dips of the supply, tried at each operation", BrownOut, array=True
    )

    @classmethod
    def read(cls, path: Path) -> Self:
        """The scenario of a TOML file.

        Raises:
            ScenarioError: names the file, and what is wrong with it.
            OSError: it cannot be read.
        """
        try:
            given = read_toml(path)
            POWERFAIL_SCENARIO.check(given.pop("version", None))
            return cls(**read_table(given, cls.declared()))
        except ValueError as error:
            raise ScenarioError(f"{path}: {error}") from None

    def __post_init__(self) -> None:
        for name, one in self.declared().items():
            if not isinstance(getattr(self, name), tuple):  # tables, which check themselves
                self._check(one)
        for name in ("question", "step"):
            if not getattr(self, name):
                raise self.refusal(name, f"must be one [[{name}]] or more")
        names = [one.name for one in self.question]
        if len(set(names)) < len(names):
            raise ScenarioError(f"two questions have the same name: {', '.join(names)}")
        for place, step in enumerate(self.step, start=1):
            for name, value in (step.state or {}).items():
                if name not in names:
                    raise ScenarioError(f"step {place}: no question {name!r}; there are {names}")
                if not isinstance(value, str):
                    raise ScenarioError(f"step {place}: {name} must be text, not {value!r}")


Answers = tuple[str | None, ...]
"""To the questions of a scenario in their order; None for no answer."""

"""Every kind on every device that has it: a test shows it, and docs/faults.md says what happens."""

import importlib
import inspect
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from cubestack.emulator.faults.table import FAULTS

from .bench import BENCHES

HERE = Path(__file__).parent
DOCUMENT = HERE.parents[2] / "docs" / "faults.md"

FIXTURES = {
    "star": ("cubestar",),
    "sense": ("cubesense",),
    "quiet": ("cubesense",),
    "tracker": ("aramis",),
}
ANY = "bench"

HEAD = ("kind", "CubeStar", "CubeSense", "AraMiS")
REFUSES = "Refused."

Pair = tuple[str, str]


@pytest.fixture(scope="module")
def supported() -> dict[Pair, bool]:
    """(kind, device) of all that has a target, and whether it can be injected."""
    pairs = {}
    for device, power_up in BENCHES.items():
        with power_up() as bench:
            for kind, fault in FAULTS.items():
                if bench.faults.targets(fault.site):
                    pairs[kind, device] = kind in bench.faults.kinds()
    return pairs


def modules() -> Iterator[ModuleType]:
    """Test modules beside this one."""
    for path in sorted(HERE.glob("test_*.py")):
        yield importlib.import_module(f".{path.stem}", __package__)


def fixtures_of(function: Callable[..., Any], module: ModuleType) -> Iterator[str]:
    """Names of a test's fixtures, and of those that these want."""
    for name in inspect.signature(function).parameters:
        yield name
        made = getattr(module, name, None)
        if made is not None:
            yield from fixtures_of(inspect.unwrap(made.__wrapped__), module)


def shown(function: Callable[..., Any], module: ModuleType) -> Iterator[Pair]:
    """(kind, device) that a test is marked to show."""
    marks = getattr(function, "pytestmark", [])
    kinds: set[str] = set()
    for mark in marks:
        if mark.name == "fault":
            kinds |= set(mark.args) or _parameter(marks, "kind")
    for name in fixtures_of(function, module):
        for device in BENCHES if name == ANY else FIXTURES.get(name, ()):
            yield from ((kind, device) for kind in kinds)


def _parameter(marks: list[pytest.Mark], wanted: str) -> set[str]:
    """Values of a parameter."""
    for mark in marks:
        if mark.name == "parametrize":
            names = mark.args[0]
            if names == wanted:
                return set(mark.args[1])
            if wanted in names:
                return {values[list(names).index(wanted)] for values in mark.args[1]}
    raise AssertionError(f"no parameter {wanted!r}")


def test_a_test_shows_every_kind_on_every_device_that_has_it(supported: dict[Pair, bool]) -> None:
    found = {
        pair
        for module in modules()
        for function in vars(module).values()
        if inspect.isfunction(function) and function.__name__.startswith("test_")
        for pair in shown(function, module)
    }
    assert found == {pair for pair, injected in supported.items() if injected}


def test_the_document_says_what_happens_to_every_kind_on_every_device(
    supported: dict[Pair, bool],
) -> None:
    part = DOCUMENT.read_text(encoding="utf-8").split("## What the firmware does about it\n")[1]
    lines = [line for line in part.split("\n## ")[0].splitlines() if line.startswith("|")]
    head, _, *rows = ([cell.strip() for cell in line[1:-1].split("|")] for line in lines)
    assert tuple(head) == HEAD
    assert [row[0] for row in rows] == [f"`{kind}`" for kind in FAULTS]
    for kind, row in zip(FAULTS, rows, strict=True):
        for device, cell in zip(BENCHES, row[1:], strict=True):
            assert bool(cell) is ((kind, device) in supported), (kind, device)
            assert (cell == REFUSES) is (supported.get((kind, device)) is False), (kind, device)

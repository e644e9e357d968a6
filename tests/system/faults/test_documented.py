from itertools import product
from pathlib import Path

import pytest

from cubestack.emulator.faults.declaration import Site
from cubestack.emulator.faults.table import FAULTS

from .bench import BENCHES, powered

HERE = Path(__file__).parent
DOCUMENT = HERE.parents[2] / "docs" / "reference" / "fault-kinds.md"

Pair = tuple[str, str]


@pytest.fixture(scope="module")
def supported() -> dict[Pair, bool]:
    """Whether a kind can be injected, for each (kind, device) with a target."""
    pairs = {}
    for device in BENCHES:
        with powered(device) as bench:
            for kind, fault in FAULTS.items():
                if bench.faults.targets(fault.site):
                    pairs[kind, device] = kind in bench.faults.kinds()
    return pairs


class Shown:
    """Collects the (kind, device) pairs of marked tests."""

    def __init__(self) -> None:
        self.pairs: set[Pair] = set()

    def pytest_collection_modifyitems(self, items: list[pytest.Function]) -> None:
        for item in items:
            if (marker := item.get_closest_marker("fault")) is not None:
                values = item.callspec.params
                devices = [device for device in BENCHES if device in values.values()]
                self.pairs |= {*product(marker.args or [values["kind"]], devices)}


def test_every_kind_is_tested_on_every_device(supported: dict[Pair, bool]) -> None:
    shown = Shown()
    arguments = ["--collect-only", "-q", "-p", "no:cacheprovider"]
    assert pytest.main([*arguments, str(HERE)], plugins=[shown]) is pytest.ExitCode.OK
    assert shown.pairs == {pair for pair, injected in supported.items() if injected}


def test_document_describes_every_kind_on_every_device(supported: dict[Pair, bool]) -> None:
    part = DOCUMENT.read_text(encoding="utf-8").split("## What the firmware does about it\n")[1]
    lines = [line for line in part.split("\n## ")[0].splitlines() if line.startswith("|")]
    head, _, *rows = ([cell.strip() for cell in line[1:-1].split("|")] for line in lines)
    assert head == ["kind", "CubeStar", "CubeSense", "AraMiS"]
    assert [row[0] for row in rows] == [f"`{kind}`" for kind in FAULTS]
    for kind, row in zip(FAULTS, rows, strict=True):
        for device, cell in zip(BENCHES, row[1:], strict=True):
            injected = supported.get((kind, device))
            if FAULTS[kind].site is Site.CORE and device == "cubestar":
                injected = True  # with own firmware, which no bench has
            assert (bool(cell), cell == "Rejected.") == (injected is not None, injected is False)

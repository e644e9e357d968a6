import re
from collections.abc import Callable
from pathlib import Path

import pytest

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue

from ..cubesense.harness import Harness as CubeSense
from ..cubestar.harness import Harness as CubeStar

DOCS = Path(__file__).parents[3] / "docs" / "sensors"
NEXT_US = 5_000  # from one request to the next: settings are applied, measurements are not over


def exchanges(page: str) -> list[tuple[str, str]]:
    blocks = re.findall(r"```wire\n(.*?)```", (DOCS / page).read_text("utf-8"), re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines()]
    sent = [line[3:] for line in lines if line.startswith("-> ")]
    received = [line[3:] for line in lines if line.startswith("<- ")]
    assert len(sent) == len(received) == len(lines) / 2 > 0
    return list(zip(sent, received, strict=True))


@pytest.mark.parametrize(
    ("page", "power_on", "pause_us"),
    [("protocols.md", CubeStar, None), ("protocols-cubesense.md", lambda _: CubeSense(), NEXT_US)],
)
def test_examples_of_the_page(
    page: str,
    power_on: Callable[[StarCatalogue], CubeStar | CubeSense],
    pause_us: int | None,
    catalogue: StarCatalogue,
) -> None:
    unit = power_on(catalogue)
    for request, answer in exchanges(page):
        assert unit.wire(bytes.fromhex(request)).hex(" ") == answer, request
        unit.run(None if pause_us is None else unit.now_us + pause_us)

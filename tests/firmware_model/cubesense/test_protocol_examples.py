"""The byte examples of docs/protocols-cubesense.md come out of the firmware."""

import re
from pathlib import Path

from cubestack.firmware_model.cubesense.hardware import Port

from .bench import Bench

PAGE = Path(__file__).parents[3] / "docs" / "protocols-cubesense.md"
NEXT_US = 5_000  # from one request to the next: settings are applied, measurements are not over


def exchanges() -> list[tuple[str, str]]:
    blocks = re.findall(r"```wire\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines()]
    sent = [line[3:] for line in lines if line.startswith("-> ")]
    received = [line[3:] for line in lines if line.startswith("<- ")]
    assert len(sent) == len(received) == len(lines) / 2 > 0
    return list(zip(sent, received, strict=True))


def test_examples_of_the_page(bench: Bench) -> None:
    for request, answer in exchanges():
        bench.uart(bytes.fromhex(request))
        found = bytes(bench.sent[Port.NODE])
        bench.sent[Port.NODE].clear()
        assert found.hex(" ") == answer, request
        bench.run(bench.now_us + NEXT_US)

"""The byte examples of docs/protocols.md come out of the firmware."""

import re
from pathlib import Path

from cubestack.firmware_model.interface.codec.frames import encode_frame

from .bench import Bench

PAGE = Path(__file__).parents[3] / "docs" / "protocols.md"


def exchanges() -> list[tuple[str, str]]:
    blocks = re.findall(r"```wire\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines()]
    sent = [line[3:] for line in lines if line.startswith("-> ")]
    received = [line[3:] for line in lines if line.startswith("<- ")]
    assert len(sent) == len(received) == len(lines) / 2 > 0
    return list(zip(sent, received, strict=True))


def test_examples_of_the_page(bench: Bench) -> None:
    for request, answer in exchanges():
        payloads = bench.uart(bytes.fromhex(request))
        bench.run()
        assert [encode_frame(payload).hex(" ") for payload in payloads] == [answer], request

import re
from pathlib import Path

from .desk import Desk

PAGE = Path(__file__).parents[4] / "docs" / "sensors" / "protocols-aramis.md"
NEXT_S = 1.5  #: From one request to the next: a measurement is over by then


def exchanges() -> list[tuple[str, str]]:
    blocks = re.findall(r"```wire\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines()]
    sent = [line[3:] for line in lines if line.startswith("-> ")]
    received = [line[3:] for line in lines if line.startswith("<- ")]
    assert len(sent) == len(received) == len(lines) / 2 > 0
    return list(zip(sent, received, strict=True))


def test_examples_of_the_page() -> None:
    line = Desk().board.serial()
    line.read(1, 0.1)
    for request, answer in exchanges():
        line.write(bytes.fromhex(request))
        found = b""
        while data := line.read(1000, NEXT_S if not found else 0.01):
            found += data
        assert found.hex(" ") == answer, request
        line.read(1, NEXT_S)


def test_the_page_names_every_use_case_s_telecommands() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for name in ("Activate", "SetSystemTime", "GetAttitude", "LatchUpAction", "SetBodyRotation"):
        assert name in text

"""The blocks of code in README.md and docs/, and what a reader has when he comes to them."""

import re
import shlex
import textwrap
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]

BLOCK = re.compile(r"^( *)```([^\n]*)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
ENVIRONMENT = re.compile(r"[A-Z_]+=\S*")

#: Commands that serve until Ctrl-C.
SERVES = r"^emulate\b|^ground\b"

#: Of these, those that make a port of a name.
MAKES_PORT = r"^emulate\b"

#: Commands that need what a reader has to bring, or that wait for him; and what that is.
LEFT = {
    r"\bglow\b": "a device of the text: tests/examples/test_adding_a_sensor.py",
    r"/dev/ttyUSB0|\./tty": "a port that somebody has to serve",
    r"^ground run\.rec": "a recording of such a port",
    r"program\.elf|picture\.elf": "needs the firmware of tests/system/test_own_firmware.py",
    r"sky\.jpg|night/|bench/": "needs photographs",
    r"^run -- bash|my_script\.py|^hdl wave|^shell emulated:cubesense$": "the reader's turn",
}

#: Commands that take minutes to hours.
LONG = r"^campaign (?!--list)|^upsets|^fidelity|^costs|^hdl|^bench|^layouts"


class Code(NamedTuple):
    """A block: its document, its language, and its text."""

    document: str
    language: str
    text: str


def blocks(*documents: Path) -> Iterator[Code]:
    """All blocks in their order; by default of README.md, then of docs/."""
    for path in documents or (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))):
        for indent, language, text in BLOCK.findall(path.read_text(encoding="utf-8")):
            yield Code(path.name, language, textwrap.dedent(text) if indent else text)


BLOCKS = list(blocks())


def words_of(text: str) -> list[str]:
    """Words of a command of a shell, without environment and comments."""
    words = shlex.split(text, comments=True)
    while words and ENVIRONMENT.fullmatch(words[0]):
        del words[0]
    return words


def lines_of(text: str) -> list[str]:
    """Commands of a block of shell, as they stand there."""
    joined = text.replace("\\\n", " ").splitlines()
    return [line for line in joined if words_of(line)]


def own_call(words: list[str]) -> str | None:
    """A command of this project as one line, without its name, `&` and redirections; else None."""
    if Path(words[0]).name != "cubestack":
        return None
    return shlex.join(takewhile(lambda word: word not in ("|", ">", "&", "&&", ";"), words[1:]))


def reader_files() -> dict[str, str]:
    """Files that the documents name, with what they say of them."""
    texts = {
        name: next(one.text for one in BLOCKS if one.document == page and one.language == "toml")
        for name, page in {
            "unit.toml": "calibration.md",
            "plan.toml": "faults.md",
            "false-stars.toml": "campaigns.md",
        }.items()
    }
    sky = 'kind = "sky"\nra_deg = 83.8\ndec_deg = -5.4\n'
    return texts | {"sky.toml": sky, "drift.toml": sky, "sun.toml": 'kind = "earth-sun"\n'}

"""The blocks of code in README.md and docs/, and the files that they need."""

import re
import shlex
import textwrap
from collections.abc import Iterator
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[3]

BLOCK = re.compile(r"^( *)```([^\n]*)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
ENVIRONMENT = re.compile(r"[A-Z][A-Z_0-9]*=\S*")

SERVES = r"^emulate\b(?!.* --timeout)|^ground\b"  # until Ctrl-C
MAKES_PORT = r"^emulate\b"

#: Commands that need something from the reader, and the reason.
LEFT = {
    r"\bglow\b": "a device of the text: tests/examples/test_adding_a_sensor.py",
    r"/dev/ttyUSB0|\./tty": "a port that another program serves",
    r"^ground run\.rec": "a recording of such a port",
    r"program\.elf|picture\.elf": "firmware: tests/system/firmware/test_own_firmware.py",
    r"settings\.elf": "firmware: tests/host/studies/powerfail/test_settings_store.py",
    r"sky\.jpg|night/|bench/": "needs photographs",
    r"stars\.jsonl": "needs stars of a unit: tests/system/test_calibrate.py",
    r"qemu-system-arm|\./star_tracker": "programs of others: tests/system/serial_programs",
    r"flight": "the reader's flight software",
    r"binned:Binned": "in its folder: examples/own_gateware/tests",
    r"^run -- bash|my_script\.py|^hdl wave|^shell emulated:cubesense$": "the reader's turn",
}

#: Commands that take minutes to hours.
LONG = r"^campaign (?!--list)|^upsets|^fidelity|^costs|^hdl|^bench|^layouts|^compare"


class Code(NamedTuple):
    document: str
    language: str
    text: str


def blocks(*documents: Path) -> Iterator[Code]:
    """All blocks in order; by default of README.md, then of docs/."""
    for path in documents or (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))):
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

    joined = text.replace("\\\n", " ").splitlines()
    return [line for line in joined if words_of(line)]


def own_call(words: list[str]) -> str | None:
    """A `cubestack` command without its name, `&` and redirections; None for other commands."""
    if Path(words[0]).name != "cubestack":
        return None
    ends = "|", "||", ">", "&", "&&", ";"
    return shlex.join(takewhile(lambda word: word not in ends, words[1:]))


def reader_files() -> dict[str, str]:
    """Files that the documents name, with the content that they show."""
    pages = {"unit": "calibration", "plan": "faults", "false-stars": "campaigns"}
    pages |= {"save": "powerfail"}
    texts = {
        f"{name}.toml": next(
            one.text for one in BLOCKS if one.document == f"{page}.md" and one.language == "toml"
        )
        for name, page in pages.items()
    }
    sky = 'kind = "sky"\nra_deg = 83.8\ndec_deg = -5.4\n'
    return texts | {"sky.toml": sky, "drift.toml": sky, "sun.toml": 'kind = "earth-sun"\n'}

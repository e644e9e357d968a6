"""The page of the comparisons: tables between its marks, and a figure for each comparison."""

from pathlib import Path

from cubestack.host.output import output_folder, write_output, write_outputs
from cubestack.host.studies.compare.recorded import stored_rows
from cubestack.host.studies.compare.studies import STUDIES
from cubestack.host.studies.compare.study import tables, verdicts

PAGE = "compare.md"
PICTURES = Path("images") / "compare"


def marks(name: str) -> tuple[str, str]:
    return f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"


def check(folder: Path) -> None:
    """Create the folder; raises ValueError if it cannot be, or if its page has no place for us."""
    text = _text(folder)
    for name in STUDIES:
        for mark in marks(name):
            if mark not in text:
                raise ValueError(f"--out: {folder / PAGE} has no line {mark.strip()}")
    output_folder(folder / PICTURES)


def write(folder: Path, study: str) -> int:
    """Write a comparison's part of the page and its figure; returns the number of files."""
    found = stored_rows(folder, study)
    drawn = STUDIES[study].plot({one.title: rows for one, rows in found.values()})
    write_outputs(folder / PICTURES, {f"{study}.png": drawn})
    write_output(folder / PAGE, rewritten(_text(folder), folder, study))
    return 2


def rewritten(text: str, folder: Path, study: str) -> str:
    """The page with a comparison's part as the stored rows have it."""
    found = stored_rows(folder, study)
    begin, end = marks(study)
    before, after = text.split(begin)[0], text.split(end, 1)[1]
    parts = [tables(STUDIES[study], one.title, rows) for one, rows in found.values()]
    parts.append(f"![{study}]({PICTURES.as_posix()}/{study}.png)\n")
    parts.append(verdicts(STUDIES[study], found))
    return f"{before}{begin}\n" + "\n".join(parts) + f"\n{end}{after}"


def _text(folder: Path) -> str:
    path = folder / PAGE
    if path.is_file():
        return path.read_text("utf-8")
    return "# Comparisons\n\n" + "\n".join("".join(marks(name)) for name in STUDIES)

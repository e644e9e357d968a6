"""Figures within the text of pages.

A comment has the text with names where figures are; below it stands the same text with the stored
figures::

    <!-- figures
    Right: {walker: slow, published: right: .1f} %.
    -->

    Right: 97.5 (92.9 to 99.2) %.

    <!-- end of figures -->

A name consists of a file of measurements (without its ending), a measurement, one of its figures,
and its format, each after a colon. A format that ends in "alone" leaves out the limits.
"""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from cubestack.host.studies.rows.record import Measurement, load

FOLDER = "data"
"""Of the documentation: measurements."""

_BLOCK = re.compile(r"<!-- figures\n(.*?)\n-->\n\n.*?\n\n<!-- end of figures -->\n", re.DOTALL)
_NAME = re.compile(r"\{([\w-]+): ([^:{}]+): ([^:{}]+): ([^:{} ]*)( alone)?\}")

Stored = Mapping[str, Mapping[str, Measurement]]
"""Measurements by file and name."""


def stored_in(docs: Path) -> Stored:
    """Measurements of the files that pages name."""
    files = {file for page in pages_with_figures(docs) for file, _, _ in names_in(page)}
    return {file: load(docs / FOLDER / f"{file}.json") for file in sorted(files)}


def pages_with_figures(docs: Path) -> list[Path]:
    return [path for path in sorted(docs.rglob("*.md")) if _BLOCK.search(path.read_text("utf-8"))]


def names_in(page: Path) -> Iterator[tuple[str, str, str]]:
    """File, measurement and figure of each name in a page's comments."""
    for block in _BLOCK.finditer(page.read_text("utf-8")):
        for name in _NAME.finditer(block[1]):
            yield name[1], name[2], name[3]


def missing(page: Path, stored: Stored) -> list[str]:
    """Names in a page's comments that no measurement has."""
    return [
        ": ".join(name)
        for name in names_in(page)
        if name[1] not in stored.get(name[0], {}) or name[2] not in stored[name[0]][name[1]].figures
    ]


def filled(page: Path, stored: Stored) -> str:
    """A page with its blocks of figures renewed; those that lack one stay as they are."""

    def value(name: re.Match[str]) -> str:
        found = stored[name[1]][name[2]].figures[name[3]]
        return format(float(found) if name[5] else found, name[4]).replace("nan", "-")

    def block(old: re.Match[str]) -> str:
        try:
            new = _NAME.sub(value, old[1])
        except KeyError:
            return old[0]
        return f"<!-- figures\n{old[1]}\n-->\n\n{new}\n\n<!-- end of figures -->\n"

    return _BLOCK.sub(block, page.read_text("utf-8"))

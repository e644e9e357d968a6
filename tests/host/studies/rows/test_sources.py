"""Which changes of source text change a digest, and which definitions a measurement depends on."""

from collections.abc import Callable
from pathlib import Path

import pytest

from cubestack.host.studies.rows import sources

LIMITS = '''"""Limits."""
from cubestack.emulator.units import METRE

USED = 3 * METRE
OTHER = 5
DERIVED = USED + 1


def ran():
    return DERIVED


def idle():
    return OTHER


class Table:
    entry = USED

    def method(self):
        return OTHER
'''
UNITS = "METRE = scaled(100)\nFOOT = 30\n\n\ndef scaled(value):\n    return 10 * value\n"
STUDY = '''from cubestack.emulator import limits
from cubestack.emulator.limits import Table, idle, ran


def shown():
    """Documented."""
    return ran(), Table, helper()  # a comment


def helper():
    return limits.DERIVED


def another():
    return 1


def cached():
    return limits.__file__


class Kept:
    share = 0.5

    @property
    def value(self):
        return self.share

    def size(self):
        return 7
'''

Change = Callable[[str, str, str], None]


@pytest.fixture
def change(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Change:
    """A project of three modules; changes the text of one."""
    monkeypatch.setattr(sources, "ROOT", tmp_path)
    for cached in (sources.source, sources.digest):
        cached.cache_clear()
    texts = {
        "emulator/limits.py": LIMITS,
        "emulator/units.py": UNITS,
        "emulator/__init__.py": "",
        "host/studies/study.py": STUDY,
    }
    for file, text in texts.items():
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_text(text)

    def replace(file: str, old: str, new: str) -> None:
        assert old in texts[file]
        (tmp_path / file).write_text(texts[file].replace(old, new))
        for cached in (sources.source, sources.digest):
            cached.cache_clear()

    return replace


def digests(entries: list[str]) -> list[str]:
    return [sources.digest(entry) for entry in entries]


SHOWN = ("host/studies/study.py", "shown")


@pytest.mark.parametrize(
    ("file", "old", "new", "counts"),
    [
        ("host/studies/study.py", "# a comment", "", False),
        ("host/studies/study.py", "Documented.", "Other words.", False),
        ("host/studies/study.py", "return ran()", "return 2, ran()", True),
        ("host/studies/study.py", "return 1", "return 2", False),
        ("emulator/limits.py", "USED = 3", "USED = 4", True),
        ("emulator/limits.py", "entry = USED", "entry = 2 * USED", True),
        ("emulator/limits.py", "        return OTHER", "        return 2 * OTHER", False),
        ("emulator/limits.py", "OTHER = 5", "OTHER = 6", False),
        ("emulator/limits.py", "    return OTHER\n\n\nclass", "    return 1\n\n\nclass", False),
        ("host/studies/study.py", "return self.share", "return 2 * self.share", True),
        ("host/studies/study.py", "share = 0.5", "share = 0.6", True),
        ("host/studies/study.py", "return 7", "return 8", False),
        ("emulator/units.py", "100", "101", True),
        ("emulator/units.py", "10 * value", "11 * value", True),
        ("emulator/units.py", "FOOT = 30", "FOOT = 31", False),
    ],
)
def test_changes_count_for_what_ran_and_the_constants_that_it_uses(
    change: Change, file: str, old: str, new: str, counts: bool
) -> None:
    entries = sources.entries({SHOWN, *((SHOWN[0], name) for name in ("helper", "Kept.value"))}, ())
    before = digests(entries)
    assert all(before)
    change(file, old, new)
    assert (digests(entries) != before) is counts


def test_sources_in_c_count_with_the_module_beside_them(change: Change, tmp_path: Path) -> None:
    (tmp_path / "emulator" / "limits.cpp").write_text("1")
    (tmp_path / "emulator" / "alone.h").write_text("1")
    files = ("emulator/limits.cpp", "emulator/alone.h")
    assert sources.entries((), files) == ["emulator/alone.h"]
    assert "emulator/limits.cpp" in sources.entries([("emulator/limits.py", "ran")], files)


def test_missing_file_has_an_empty_digest(change: Change) -> None:
    assert sources.digest("emulator/none.json") == ""
    assert sources.digest("emulator/none.py:NAME") == ""


@pytest.mark.parametrize(
    ("file", "old", "counts"),
    [("emulator/limits.py", "OTHER = 5", True), ("host/studies/study.py", "return 1", False)],
)
def test_a_function_that_reads_a_source_depends_on_all_of_it(
    change: Change, file: str, old: str, counts: bool
) -> None:
    entries = sources.entries({(SHOWN[0], "cached")}, ())
    before = digests(entries)
    change(file, old, old[:-1] + "9")
    assert (digests(entries) != before) == counts


BOUND = """
FIRST, (SECOND, *REST) = [item for item in range(3) if (KEPT := item)]
if FIRST:
    def choice():
        local = 1
        return [local for each in REST]
else:
    choice = None
"""


def test_variables_of_comprehensions_and_functions_are_no_names_of_the_module(
    change: Change, tmp_path: Path
) -> None:
    (tmp_path / "emulator" / "bound.py").write_text(BOUND)
    defined = sources.source("emulator/bound.py").defined
    assert {*defined} == {"FIRST", "SECOND", "REST", "KEPT", "choice"}

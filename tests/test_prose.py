import pytest

from tests import prose


@pytest.mark.parametrize(
    ("path", "text", "line"),
    [
        ("a.md", "First.\n\nThe clock is\ntold the time.\n", 3),
        ("a.py", "x = 1\n# It is\n#    told.\n", 2),
        ("a.py", 'def f():\n    """It is told."""\n', 2),
        ("a.py", 'raise ValueError(\n    "it is "\n    "told"\n)\n', 2),
        ("a.py", "def test_time_is_told(): ...\n", 1),
        ("a.cpp", "int a; // it is\n// told\n", 1),
        ("a.h", "/* It\n * is told. */\n", 2),
        ("a.js", "throw `It is told`;\n", 1),
    ],
)
def test_finds_phrase_in_prose(path: str, text: str, line: int) -> None:
    assert [*prose.hits(path, text)] == [(line, "is told", "is reported, receives")]


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("a.md", "```\nis told\n```\nUse `is told`.\n"),
        ("a.py", 'is_told = "is" + x.told\n'),
        ("a.c", "it.is->told = 1;\n"),
        ("a.js", "const is = told;\n"),
    ],
)
def test_prose_check_ignores_code(path: str, text: str) -> None:
    assert not [*prose.hits(path, text)]


@pytest.mark.slow
def test_repository_has_no_prose_hits(capsys: pytest.CaptureFixture[str]) -> None:
    assert prose.main() == 0, capsys.readouterr().out

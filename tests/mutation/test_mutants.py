import ast
import json
from pathlib import Path

import pytest
from coverage import CoverageData

from tests.mutation.__main__ import chosen
from tests.mutation.mutants import Mutant, modules, mutants
from tests.mutation.reached import DATA, DOCUMENTS, FOLDER, MOST_TESTS, TIMES, Reached
from tests.mutation.trial import ROOT, files_for, near
from tests.together import together

HERE = Path("a.py")


def record(root: Path, tests: dict[str, float], ran: list[tuple[str, int]], path: Path) -> Reached:
    """A recorded run: the seconds of tests, and the contexts with the line of ``path`` they ran."""
    (root / FOLDER).mkdir(parents=True)
    (root / FOLDER / TIMES).write_text(json.dumps(tests), "utf-8")
    data = CoverageData(str(root / FOLDER / DATA))
    for context, line in ran:
        data.set_context(context)
        data.add_lines({str(path): [line]})
    data.write()
    return Reached(root)


@together(
    ("text", "expected"),
    [
        ("a < b", ["(a <= b)"]),
        ("a + b", ["(a - b)"]),
        ("a -= b", ["a += b"]),
        ("f(7)", ["pass", "f((8))"]),
        ("if a:\n    f()", ["if (not (a)):\n    f()", "if a:\n    pass"]),
        ("def f():\n    return a", ["def f():\n    pass"]),
        ("def f():\n    return None", []),
        (
            "def f():\n    if a:\n        return None\n    g()",
            [
                "def f():\n    if (not (a)):\n        return None\n    g()",
                "def f():\n    if a:\n        pass\n    g()",
                "def f():\n    if a:\n        return None\n    pass",
            ],
        ),
        ("raise a", ["pass"]),
        ("a = 'é', b is None", ["a = 'é', (b is not None)"]),
        ("a: Literal[3] = True", []),
        ("a = f'{b + 1}'", []),
        ("def f(a: Literal[1] = 3) -> Literal[2]: ...", []),
        ("def f(a=3):\n    'It does.'", []),
        ("def f(a=3):\n    b", ["def f(a=(4)):\n    b"]),
        ("a = (255, 90, 60)", []),
        ("def f(a: Literal[1]) -> Literal[2]: ...", []),
    ],
)
def test_source_text_yields_the_expected_mutants(text: str, expected: list[str]) -> None:
    assert sorted(m.put_into(text) for m in mutants(HERE, text)) == sorted(expected)


def test_every_mutant_parses_and_differs() -> None:
    for path in modules(ROOT)[::40]:
        text = (ROOT / path).read_text("utf-8")
        for mutant in mutants(path, text)[::20]:
            assert ast.dump(ast.parse(mutant.put_into(text))) != ast.dump(ast.parse(text)), mutant


def test_seed_determines_the_selection() -> None:
    folder = Path("firmware_model/attitude")
    one, same, other = ([str(m) for m in chosen(folder, seed)] for seed in (1, 1, 2))
    assert one == same != other
    assert sorted(one) == sorted(other)


def test_mutant_selection_of_a_file_survives_changes_in_other_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tests.mutation.__main__.ROOT", tmp_path)
    code = "\n".join(f"x{n} = a < {n} + b" for n in range(20)) + "\n"
    for name in ("one", "other"):
        (tmp_path / "host" / name).mkdir(parents=True)
        (tmp_path / "host" / name / "made.py").write_text(code)

    def changes() -> list[tuple[Path, str, str]]:
        all_ = chosen(Path(), 1)
        return [(m.path, m.before, m.after) for m in all_ if "one" in m.path.parts]

    before = changes()
    (tmp_path / "host" / "other" / "made.py").write_text(code + code)
    (tmp_path / "host" / "one" / "made.py").write_text("# a comment\n" + code)
    assert changes() == before
    first = [m.path for m in chosen(Path(), 1)[:60]]
    assert 5 < sum("one" in path.parts for path in first) < 30  # of a third of all lines


def test_mirrored_test_file_comes_first() -> None:
    """Then importing ones, then neighbours."""
    found = files_for(Path("firmware_model/attitude/quest.py"))
    assert found[0] == Path("tests/firmware_model/attitude/test_quest.py")
    beside = [file for file in found if file.parent == found[0].parent]
    assert beside == found[: max(3, len(beside))]
    imports = ["attitude.quest import" in (ROOT / file).read_text("utf-8") for file in beside[1:]]
    assert any(imports)
    assert imports == sorted(imports, reverse=True)


def test_unrecorded_tests_are_run_for_near_modules(tmp_path: Path) -> None:
    own = "tests/firmware_model/attitude/test_quest.py::"
    other = "tests/emulator/bus/test_uart.py::"
    recorded = {own + "test_old": 1.0, own + "test_gone": 1.0, other + "test_old[1]": 1.0}
    reached = record(tmp_path, recorded, [], HERE)
    new = [other + "test_old[2]", own + "test_new"]
    assert reached.update({own + "test_old", other + "test_old[1]", *new}) == new
    assert reached.durations.keys() == {own + "test_old", other + "test_old[1]"}
    assert near(Path("firmware_model/attitude/quest.py"), new) == [own + "test_new"]
    assert near(Path("emulator/bus/uart.py"), new) == [other + "test_old[2]"]


def test_mutant_runs_against_the_tests_that_cover_its_line(tmp_path: Path) -> None:
    # However many they are, the others are faced as well.
    of_documents = [f"{DOCUMENTS[0]}::test_defaults[{number}]" for number in range(MOST_TESTS)]
    names = "tests/test_a.py::test_f", "test_b.py::test_g", "test_c.py::test_h", *of_documents
    ran = [("", 1), ("tests/test_a.py::test_f|run", 3), ("test_b.py::test_g|run", 4)]
    reached = record(tmp_path, dict.fromkeys(names, 1.0), ran, HERE)
    for line, expected in ((3, ["tests/test_a.py::test_f"]), (4, ["test_b.py::test_g"])):
        assert reached.tests(Mutant(HERE, line, line, line, 0, 1, "a", "b"), set()) == expected
    at_import = Mutant(HERE, 1, 1, 1, 0, 1, "a", "b")
    run, beside = ["tests/test_a.py::test_f", "test_b.py::test_g"], "test_c.py::test_h"
    assert reached.tests(at_import, set()) == [*run, *of_documents]
    assert reached.tests(at_import, {"test_c.py"}) == [*run, beside, *of_documents]


def test_tests_of_the_module_come_first(tmp_path: Path) -> None:
    own = [f"tests/mutation/test_mutants.py::test_a[{number}]" for number in range(99)]
    beside = [f"tests/mutation/test_other.py::test_b[{number}]" for number in range(99)]
    slow, far = "tests/mutation/test_mutants.py::test_slow", "tests/test_far.py::test_c"
    recorded = {slow: 11.0, far: 0.001} | dict.fromkeys(beside, 0.01) | dict.fromkeys(own, 0.02)
    path = Path("mutation/mutants.py")
    reached = record(tmp_path, recorded, [(f"{test}|run", 1) for test in recorded], path)
    faced = reached.tests(Mutant(path, 1, 1, 1, 0, 1, "a", "b"), set())
    assert set(faced[:99]) == set(own)
    assert 98 < faced.index(beside[0]) < faced.index(slow) < faced.index(far)

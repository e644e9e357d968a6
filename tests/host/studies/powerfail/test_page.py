"""The how-to page lists every key and verdict as it is declared."""

import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest

from cubestack.host.studies.powerfail.scenario import BrownOut, Question, Scenario, Step
from cubestack.host.studies.powerfail.trial import FORGOTTEN, MEANINGS
from tests.conftest import Run
from tests.emulator.iss.cross_compiler import needs_compiler
from tests.system.documents.blocks import blocks, lines_of, own_call, words_of

ROOT = Path(__file__).parents[4]
PAGE = ROOT / "docs" / "how-to" / "powerfail.md"

TABLES = {"": Scenario, "question.": Question, "step.": Step, "brown_out.": BrownOut}


def test_page_lists_every_key_with_its_meaning() -> None:
    page = PAGE.read_text("utf-8")
    for prefix, owner in TABLES.items():
        for name, one in owner.declared().items():
            assert f"| `{prefix}{name}` | {one.meaning}" in page


def test_page_lists_every_verdict() -> None:
    page = PAGE.read_text("utf-8")
    for verdict in MEANINGS:
        assert f"| `{verdict}` | " in page


@pytest.mark.slow
@needs_compiler
def test_page_pasted_from_an_empty_folder(
    tmp_path: Path, run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All its commands; gdb's part is in test_settings_store.py."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(ROOT / "examples" / "power_cuts", tmp_path, dirs_exist_ok=True)
    header = run("export", "cubestar", "--format", "processor-c").out
    (tmp_path / "processor.h").write_text(header)
    subprocess.run(["make", "-s", "FAULT=5"], check=True)
    for block in blocks(PAGE):
        if block.language == "toml":
            name = block.text.partition("\n")[0].removeprefix("# ")
            assert tomllib.loads(block.text)
            Path(name).write_text(block.text)
    shell = [line for one in blocks(PAGE) if one.language == "sh" for line in lines_of(one.text)]
    saved, finding = (call for line in shell if (call := own_call(words_of(line))))
    done = run(*saved.split())
    assert done.code == 0, done.err
    assert "survived" in Path("save.powerfail/report.html").read_text()
    found = run(*finding.partition(" --gdb")[0].split())
    assert found.code == 1
    assert FORGOTTEN in found.out

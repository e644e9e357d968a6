"""The store of examples/power_cuts: right as it is, and found out with each planted mistake."""

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path

import pytest

from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.host.devices.registry import device
from cubestack.host.export.processor import processor_header
from cubestack.host.studies.powerfail.cases import BROWN_OUT, KINDS, WORN, Case, cases_of
from cubestack.host.studies.powerfail.course import Course, learn
from cubestack.host.studies.powerfail.replay import Witness, replay
from cubestack.host.studies.powerfail.rig import Rig, Setup
from cubestack.host.studies.powerfail.run import fresh_rig, run
from cubestack.host.studies.powerfail.scenario import Scenario, ScenarioError
from cubestack.host.studies.powerfail.trial import FORGOTTEN, WRONG, Row
from tests.conftest import Run
from tests.emulator.iss.cross_compiler import compile_for_m3, needs_compiler

pytestmark = needs_compiler

ROOT = Path(__file__).parents[4]
EXAMPLE = ROOT / "examples" / "power_cuts"
SCENARIO = EXAMPLE / "settings.toml"

NO_CHECKSUM, SEQUENCE_FIRST, ERASED_TOO_EARLY, HALF_WORD_VALID, UNSAFE_RECOVERY = range(1, 6)

VERDICTS = {
    NO_CHECKSUM: WRONG,
    SEQUENCE_FIRST: FORGOTTEN,
    ERASED_TOO_EARLY: FORGOTTEN,
    HALF_WORD_VALID: WRONG,
    UNSAFE_RECOVERY: FORGOTTEN,
}


class Images:
    """The program with each mistake; 0 for none."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        (folder / "processor.h").write_text(processor_header(device("cubestar").processor()))  # type: ignore[misc]

    @cache  # noqa: B019
    def __getitem__(self, fault: int) -> Path:
        image = self._folder / f"settings{fault}.elf"
        flags = ("-O1", "-g", "-ffreestanding", "-nostdlib", f"-DFAULT={fault}")
        sources = (EXAMPLE / "main.c", EXAMPLE / "settings.c")
        script = EXAMPLE / "settings.ld"
        compile_for_m3(*flags, f"-I{self._folder}", "-T", script, *sources, "-lgcc", "-o", image)
        return image


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Images:
    return Images(tmp_path_factory.mktemp("store"))


def learned(image: Path, scenario: Scenario) -> tuple[Setup, Course, list[Case]]:
    setup = Setup(str(image), scenario)
    course = learn(setup, fresh_rig(setup))
    return setup, course, cases_of(scenario, course)


def tried(image: Path, scenario: Scenario, every: int = 1) -> Iterator[Row]:
    """Rows of one case in ``every``, in this process."""
    setup, course, cases = learned(image, scenario)
    for rows in run(setup, course, cases[::every], workers=1):
        yield from rows


def finding(image: Path, scenario: Scenario) -> Row:
    return next(row for row in tried(image, scenario, every=5) if not row.right)


def test_right_store_survives_every_tenth_cut(images: Images) -> None:
    rows = list(tried(images[0], Scenario.read(SCENARIO), every=10))
    assert len(rows) > 15
    assert [row for row in rows if not row.right] == []


@pytest.mark.parametrize(
    ("fault", "verdict"),
    [
        pytest.param(*one, marks=[] if one[0] == SEQUENCE_FIRST else [pytest.mark.slow])
        for one in VERDICTS.items()
    ],
)
def test_planted_mistake_is_found(images: Images, fault: int, verdict: str) -> None:
    found = finding(images[fault], Scenario.read(SCENARIO))
    assert found.verdict == verdict
    assert found.second == (fault == UNSAFE_RECOVERY)


@pytest.mark.slow
def test_the_bare_part_runs_the_same_scenario(images: Images) -> None:
    options = {"serial": "usart1@PD0,PD1"}
    bare = replace(Scenario.read(SCENARIO), device="efm32gg", options=options)
    rows = list(tried(images[0], bare, every=20))
    assert len(rows) > 7
    assert [row for row in rows if not row.right] == []
    assert finding(images[SEQUENCE_FIRST], bare).verdict == FORGOTTEN


@pytest.mark.slow
def test_right_store_survives_every_case(images: Images) -> None:
    scenario = replace(Scenario.read(SCENARIO), seed=1, between=1, worn=9)
    rows = list(tried(images[0], scenario))
    assert {row.kind for row in rows} == set(KINDS)
    assert [row for row in rows if not row.right] == []


@pytest.mark.slow
@pytest.mark.parametrize("fault", VERDICTS)
def test_findings_replay_to_the_instruction(images: Images, fault: int) -> None:
    class Pc(Witness):
        def at_cut(self, rig: Rig) -> None:
            self.pc = rig.machine.register("pc")

    setup, course, cases = learned(images[fault], Scenario.read(SCENARIO))
    symbols = Symbols(images[fault].read_bytes())
    bad = [
        row for rows in run(setup, course, cases[::8], workers=1) for row in rows if not row.right
    ]
    assert len(bad) > 2
    for row in bad[::4]:
        seen = Pc()
        assert replay(setup, course, row.case, seen) == row
        if row.share is not None and row.kind not in (BROWN_OUT, WORN):
            assert symbols.describe(seen.pc) == row.where  # before the store that begins it


@pytest.mark.slow
def test_rows_do_not_depend_on_the_number_of_workers(images: Images) -> None:
    setup, course, cases = learned(images[UNSAFE_RECOVERY], Scenario.read(SCENARIO))
    some = cases[::20]
    one, two = (
        sorted((row for rows in run(setup, course, some, workers) for row in rows), key=str)
        for workers in (1, 2)
    )
    assert one == two


def test_a_scenario_that_fails_without_cuts_says_where(images: Images) -> None:
    scenario = Scenario.read(SCENARIO)
    first, *others = scenario.step
    wrong = replace(scenario, step=(replace(first, state={"settings": "12 0 0 0"}), *others))
    with pytest.raises(ScenarioError, match=r"'11 0 0 0' after a power-up after step 1, .* '12 0"):
        learned(images[0], wrong)
    silent = replace(scenario, step=(replace(first, answer="yes"), *others))
    with pytest.raises(ScenarioError, match="step 1 is silent even without a power cut"):
        learned(images[0], silent)


@pytest.mark.slow
def test_command_writes_rows_and_page(images: Images, run: Run, tmp_path: Path) -> None:
    quick = tmp_path / "quick.toml"
    text = SCENARIO.read_text().replace("boot_s", "torn = 1\nworn = 0\nsecond = 1\nboot_s", 1)
    quick.write_text(text.partition('[[step]]\nsend = "s 0 12')[0])
    folder = tmp_path / "out"
    words = ("powerfail", images[SEQUENCE_FIRST], "--scenario", quick, "--out", folder)
    done = run(*words, "--workers", "1")
    assert done.code == 1
    assert "forgotten" in done.out
    rows = [json.loads(line) for line in (folder / "rows.jsonl").read_text().splitlines()]
    bad = [row for row in rows if row["verdict"] != "right"]
    page = (folder / "report.html").read_text()
    assert f"{len(bad)} of {len(rows)} power cuts are not survived" in page
    assert page.count("<rect") > len(rows) / 4
    assert "settings.c" in page
    assert run(*words).code == 2  # it has results
    again = run("powerfail", words[1], "--scenario", quick, "--case", bad[0]["case"], "--json")
    assert json.loads(again.out) == bad[0]
    none = run("powerfail", words[1], "--scenario", quick, "--case", "9999")
    assert none.code == 2
    assert "there are cases 0 to" in none.err


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("gdb-multiarch") is None, reason="needs gdb-multiarch")
def test_gdb_halts_at_the_cut_and_follows_the_recovery(images: Images) -> None:
    image = images[UNSAFE_RECOVERY]
    scenario = Scenario.read(SCENARIO)
    found = finding(image, scenario)
    words = ("powerfail", image, "--scenario", SCENARIO, "--case", found.case, "--gdb", "0")
    command = [sys.executable, "-m", "cubestack.host.cli.main", *map(str, words)]
    piped = subprocess.PIPE
    with subprocess.Popen(command, stderr=piped, stdout=piped, text=True) as served:
        assert served.stderr is not None
        assert served.stdout is not None
        line = next(one for one in served.stderr if one.startswith("target remote"))
        port = re.sub(r".*:", "", line.strip())
        script = [f"target remote :{port}", "bt", "break settings_load", "continue", "bt", "delete",
                  "continue"]  # fmt: skip
        steps = [word for one in script for word in ("-ex", one)]
        gdb = ["gdb-multiarch", "-q", "-batch", *steps, str(image)]
        shown = subprocess.run(gdb, capture_output=True, text=True, timeout=120).stdout
        assert "repair ()" in shown
        assert re.search(r"Breakpoint 1, settings_load", shown)
        assert f"case {found.case}: {found.verdict}" in served.stdout.read()
    assert served.returncode == 1

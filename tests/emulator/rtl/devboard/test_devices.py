"""Whole devices with the FPGA on a board behind a pseudo-terminal: the compiled engine's bytes."""

import json
from collections.abc import Iterator
from unittest.mock import patch

import pytest

from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.faults.table import FAULTS
from cubestack.host.emulation.emulated import open_device
from tests.system.test_fault_fuzz import SCENES, Fuzzer

from ....conftest import Run
from .boards import behind_pty
from .quick_board import QuickBoard

REGISTERS = [kind for kind in FAULTS if kind.startswith("register")]
"""A board has no access to them."""

TURNS = {"telemetry": 0.3, "command": 0.3, "inject": 0.35, "clear": 0.05}


@pytest.fixture
def engine() -> Iterator[str]:
    with behind_pty(QuickBoard(cubestar_wiring()).receive) as path:
        yield f"board:{path}"


@pytest.mark.slow
def test_measured_skies_are_the_same(engine: str, run: Run) -> None:
    results = []
    for kind in ("compiled", engine):
        outcome = run("measure", "cubestar", "--frames", 3, "--seed", 3, "--json", "--engine", kind)
        assert outcome.code == 0
        lines = [json.loads(line) for line in outcome.out.splitlines()]
        results.append([{**line, "wall_ms": 0} for line in lines])
    assert results[0] == results[1]
    assert all(result["right"] for result in results[1])


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_all_faults_have_the_same_effects(engine: str) -> None:
    runs, kinds = [], set()
    for kind in ("compiled", engine):
        with open_device("cubestar", SCENES["cubestar"], seed=4, engine=kind) as opened:
            fuzzer = Fuzzer(opened, 11, TURNS)
            fuzzer.kinds = [one for one in fuzzer.kinds if one not in REGISTERS]
            inject = opened.faults.inject
            with patch.object(opened.faults, "inject", side_effect=inject) as injected:
                runs.append(fuzzer.run(500))
            kinds |= {call.args[0] for call in injected.call_args_list}
            wanted = set(fuzzer.kinds)
    assert runs[0] == runs[1]
    assert kinds == wanted

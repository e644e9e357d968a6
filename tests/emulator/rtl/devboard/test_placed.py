"""Whole devices on placed netlists behind pseudo-terminals: the compiled engine's bytes.

BOARD_WHOLE=1 runs it: some ten minutes, for which nothing else must be slow.
"""

import multiprocessing
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.faults.table import FAULTS
from cubestack.hdl.devboard.boards import BOARDS
from cubestack.host.conformance.suite import run_suite
from cubestack.host.emulation.emulated import open_device
from cubestack.host.targets import open_target
from tests.system.life import life

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif("BOARD_WHOLE" not in os.environ, reason="takes ten minutes: BOARD_WHOLE=1"),
]

SKIES = 20


def kinds() -> list[str]:
    """Of faults that a CubeStar without own firmware has, and a board allows."""
    with open_device("cubestar") as opened:
        here = [kind for kind, fault in FAULTS.items() if opened.faults.targets(fault.site)]
    return [kind for kind in here if not kind.startswith("register-")]


def sky(seed: int, engine: str) -> object:
    return life(seed, engine=engine, layouts="1", kinds=[])


def fault(kind: str, engine: str) -> object:
    """A life with three faults of a kind, at random targets and times."""
    seed = list(FAULTS).index(kind)
    return life(seed, engine=engine, layouts="1", kinds=[kind] * 3)


def conformance(name: str, engine: str) -> object:
    target = open_target(f"emulated:{name}", engine=engine)
    try:
        checks = run_suite(target, allow_write=True).checks
    finally:
        target.close()
    assert any(check.verdict.value == "passed" for check in checks)
    return checks


Job = tuple[Callable[[Any, str], object], Any]


def differences(job: Job, engine: str) -> str:
    """What differs from the compiled engine's, in words; empty if nothing does."""
    play, which = job
    compiled, placed = play(which, "compiled"), play(which, engine)
    if isinstance(compiled, dict) and isinstance(placed, dict):
        for one in (compiled, placed):
            del one["registers"]  # are in the board
            one["recording"] = str(one["recording"]).splitlines()[1:]  # the first names the engine
        names = [name for name in compiled if compiled[name] != placed[name]]
        return ", ".join(names)
    return "" if compiled == placed else f"{placed} in place of {compiled}"


JOBS: dict[tuple[str, str], list[Job]] = {
    **{
        (board, "cubestar"): [
            (conformance, "cubestar"),
            *((sky, seed) for seed in range(SKIES)),
            *((fault, kind) for kind in kinds()),
        ]
        for board in ("icebreaker", "ulx3s")
    },
    ("ulx3s", "cubesense-pair"): [(conformance, "cubesense")],
}


@pytest.fixture
def addresses(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[list[str]]:
    """Of simulated boards side by side, one for each job."""
    board, top = request.param
    baud = BOARDS[board].bridge_hz // 2
    command = [sys.executable, "-m", "cubestack", "hdl", "board"]
    build = [*command, board, "--top", top, "--baud", str(baud), "--out", str(tmp_path)]
    subprocess.run(build, check=True, stderr=subprocess.DEVNULL)
    count = len(JOBS[board, top])
    simulate = [*command, "simulate", str(tmp_path), "--count", str(count)]
    with subprocess.Popen(simulate, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        yield [f"board:{process.stdout.readline().strip()}@{baud}" for _ in range(count)]
        process.send_signal(signal.SIGINT)


@pytest.mark.parametrize(
    ("addresses", "jobs"), [(key, JOBS[key]) for key in JOBS], indirect=["addresses"], ids=str
)
def test_devices_on_placed_netlists_give_the_compiled_engine_s_bytes(
    addresses: list[str], jobs: list[Job]
) -> None:
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(len(jobs), mp_context=context) as pool:
        running = {
            pool.submit(differences, job, engine): f"{job[0].__name__} {job[1]}"
            for job, engine in zip(jobs, addresses, strict=True)
        }
        found = {running[future]: future.result() for future in as_completed(running)}
    assert {name: text for name, text in found.items() if text} == {}

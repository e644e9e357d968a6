"""Whole devices on placed netlists behind pseudo-terminals: the compiled engine's bytes.

BOARD_WHOLE=1 runs it: about half an hour on a busy machine.
"""

import multiprocessing
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from cubestack.emulator.faults.table import FAULTS
from cubestack.hdl.devboard.boards import BOARDS
from cubestack.hdl.devboard.netlist import MUTANTS
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
    """With writes for one camera: two that store at once cost a request for each clock."""
    target = open_target(f"emulated:{name}", engine=engine)
    try:
        checks = run_suite(target, allow_write=name == "cubestar").checks
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
    ("ulx3s", "cubesense"): [(conformance, "cubesense")],
}


COMMAND = (sys.executable, "-m", "cubestack", "hdl", "board")


@pytest.fixture(scope="session")
def build(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, str], Path]:
    """Builds a device's design for a board, with a quick serial line; once."""
    folder = tmp_path_factory.mktemp("placed")

    def of(board: str, device: str) -> Path:
        place = folder / f"{board}-{device}"
        if not place.exists():
            call = [*COMMAND, board, "--device", device, "--baud", str(baud_of(board))]
            subprocess.run([*call, "--out", str(place)], check=True, stderr=subprocess.DEVNULL)
        return place

    return of


def baud_of(board: str) -> int:
    return BOARDS[board].bridge_hz // 2


@contextmanager
def simulated(place: Path, *options: str, count: int = 1) -> Iterator[list[str]]:
    """Ports of boards that run side by side."""
    call = [*COMMAND, "simulate", str(place), "--count", str(count), *options]
    with subprocess.Popen(call, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield [process.stdout.readline().strip() for _ in range(count)]
        finally:
            process.terminate()


@pytest.mark.parametrize(("board", "device"), JOBS)
def test_devices_on_placed_netlists_give_the_compiled_engine_s_bytes(
    board: str, device: str, build: Callable[[str, str], Path]
) -> None:
    jobs, context = JOBS[board, device], multiprocessing.get_context("spawn")
    with (
        simulated(build(board, device), count=len(jobs)) as ports,
        ProcessPoolExecutor(len(jobs), mp_context=context) as pool,
    ):
        running = {
            pool.submit(differences, job, f"board:{port}@{baud_of(board)}"): job
            for job, port in zip(jobs, ports, strict=True)
        }
        found = {running[future]: future.result() for future in as_completed(running)}
    wrong = {f"{play.__name__} {which}": text for (play, which), text in found.items() if text}
    assert wrong == {}


def differs(place: Path, board: str, *fault: str, frames: int = 1) -> bool:
    """Whether `hdl board check` finds a difference."""
    with simulated(place, *fault) as (port,):
        call = [*COMMAND, "check", f"{port}@{baud_of(board)}", "--device", "cubestar", "--json"]
        call += ["--frames", str(frames)]
        outcome = subprocess.run(call, check=False, capture_output=True, text=True)
    print(fault, outcome.stdout)
    assert outcome.returncode in (0, 1)
    return outcome.returncode == 1


@pytest.mark.parametrize("board", ["icebreaker", "ulx3s"])
@pytest.mark.parametrize("mutant", ["", *MUTANTS])
def test_check_of_the_board_finds_faults_of_the_netlist(
    board: str, mutant: str, build: Callable[[str, str], Path]
) -> None:
    """A fault may change nothing, such as a bit of a table that no state of the design selects."""
    place = build(board, "cubestar")
    if mutant:
        fault = ("--mutant", mutant, "--seed")
        assert any(differs(place, board, *fault, seed, frames=0) for seed in "0123")
    else:
        assert not differs(place, board)

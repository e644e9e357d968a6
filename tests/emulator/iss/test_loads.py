"""Loads like CoreMark and embench end with the sum that the same source has on this machine."""

import ctypes
import importlib.util
import shutil
import subprocess
from pathlib import Path

import pytest

from cubestack.emulator.iss import benchmark, loads
from cubestack.emulator.iss.image import load_image
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import Machine
from tests.emulator.iss.cross_compiler import needs_compiler
from tests.tiers import quick

FEW = 3
HOST = shutil.which("cc")
pytestmark = [needs_compiler, pytest.mark.skipif(HOST is None, reason="needs a C compiler")]


def sum_here(name: str, folder: Path, rounds: int) -> int:
    built = folder / f"{name}.so"
    flags = ("-O1", "-ffp-contract=off", "-shared", "-fPIC")
    subprocess.run([HOST or "", *flags, loads.FOLDER / f"{name}.c", "-o", built], check=True)
    load = ctypes.CDLL(str(built)).load
    load.restype = ctypes.c_uint32
    return int(load(loads.SEED, rounds))


CASES = [(name, option) for name in loads.ROUNDS for option in ("-O2", "-Os", "-O0")]


@pytest.mark.parametrize(("name", "option"), quick(CASES, 3))
def test_load_ends_with_the_sum_of_this_machine(name: str, option: str, tmp_path: Path) -> None:
    elf = loads.build(name, tmp_path, FEW, option)
    expected = sum_here(name, tmp_path, FEW)
    for machine in (Machine(), Machine(bare_hz=1_000_000)):
        benchmark.run_load(machine, load_image(elf), Symbols(elf.read_bytes()).labels["finished"])
        assert machine.register("r0") == expected


def test_pair_has_equal_results_and_times(monkeypatch: pytest.MonkeyPatch) -> None:
    if importlib.util.find_spec("unicorn") is None:
        pytest.skip("unicorn is not installed")
    monkeypatch.setattr(loads, "ROUNDS", {"searches": FEW})
    monkeypatch.setattr(benchmark, "ROUNDS", 1)
    (pair,) = benchmark.pairs()
    assert pair.name == "searches"
    assert pair.instructions > 100_000
    assert min(pair.plain_s, pair.waits_s, pair.unicorn_s) > 0


def test_ratios_are_left_out_without_unicorn(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda _name: None)
    assert benchmark.unicorn_ratios() == {}

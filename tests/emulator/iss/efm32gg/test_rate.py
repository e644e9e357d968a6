"""Edges of even clocks: exact for each rate and each time."""

import ctypes
import random
import subprocess
from pathlib import Path

import pytest

from cubestack.emulator.iss import machine
from cubestack.emulator.native import compiler

S = 10**12
COMPILER = compiler.find_compiler()
TIMEOUT_S = 300


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    if COMPILER is None:
        pytest.skip("no C++ compiler")
    target = tmp_path_factory.mktemp("rate") / "rate.so"
    source = Path(__file__).with_name("rate_harness.cpp")
    include = f"-I{Path(machine.__file__).parent}"
    command = [*COMPILER.command, *compiler.FLAGS, include, str(source), "-o", str(target)]
    subprocess.run(command, check=True, timeout=TIMEOUT_S)
    library = ctypes.CDLL(str(target))
    for function in (library.rate_time, library.rate_edges):
        function.restype, function.argtypes = ctypes.c_int64, [ctypes.c_int64] * 4
    return library


def test_edges_are_at_exact_times(library: ctypes.CDLL) -> None:
    rng = random.Random(1)
    for _ in range(20_000):
        anyhow = rng.getrandbits(rng.randrange(1, 40)) + 1
        hertz = rng.choice((48_000_000, 14_000_000, 32_768, 1 << rng.randrange(40), anyhow))
        divider = rng.choice((1, 1 << rng.randrange(20), rng.randrange(1, 1000)))
        origin, edge = rng.getrandbits(rng.randrange(1, 62)), rng.getrandbits(rng.randrange(1, 62))
        exact = origin + S * divider * edge // hertz
        assert library.rate_time(hertz, divider, origin, edge) == min(exact, machine.NEVER)
        if exact < machine.NEVER and S * divider >= hertz:  # at most an edge per picosecond
            assert library.rate_edges(hertz, divider, origin, exact) == edge
            assert library.rate_edges(hertz, divider, origin, exact - 1) <= max(0, edge - 1)

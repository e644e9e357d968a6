"""`--gateware`: the shipped design as Verilog gives the same results; errors are one line."""

import json
from collections.abc import Sequence
from pathlib import Path

import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.hdl.cubestar.tops import TOPS
from cubestack.hdl.flow.tools import have_yosys, run_yosys
from cubestack.hdl.flow.top import tops_in
from cubestack.hdl.flow.verilog import verilog_file
from cubestack.host.cli.main import main
from tests.hdl.user.designs import SYSTEM_CLOCK, WORKING

pytestmark = [
    pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler"),
    pytest.mark.skipif(not have_yosys(), reason="no whole Yosys"),
    pytest.mark.filterwarnings("default::cubestack.emulator.boards.gateware.GatewareNotice"),
]


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("exported") / "cubestar.v"
    file.write_text(verilog_file("cubestar", tops_in(TOPS)["cubestar"]))
    return file


@pytest.fixture(scope="module")
def rewritten(exported: Path) -> Path:
    """The same, flattened and optimised by another tool."""
    script = "read_verilog cubestar.v\nhierarchy -auto-top\nproc\nflatten\ntribuf\nopt -full\n"
    run_yosys(f"{script}write_verilog -noattr rewritten.v\n", exported.parent)
    return exported.parent / "rewritten.v"


def measured(capsys: pytest.CaptureFixture[str], options: Sequence[str]) -> list[dict[str, object]]:
    assert main(["measure", "cubestar", "--json", "--frames", "2", *options]) == 0
    results = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    for result in results:
        del result["wall_ms"]  # of the machine that emulates
    return results


@pytest.mark.parametrize("design", ["exported", pytest.param("rewritten", marks=pytest.mark.slow)])
def test_exported_verilog_gives_the_same_results(
    design: str, request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
) -> None:
    file = request.getfixturevalue(design)
    expected = measured(capsys, ["--seed", "5"])
    assert measured(capsys, ["--seed", "5", "--gateware", str(file)]) == expected
    assert len(expected) == 2


def refused(capsys: pytest.CaptureFixture[str], *options: str) -> str:
    assert main(["measure", "cubestar", "--frames", "1", *options]) != 0
    return capsys.readouterr().err.strip()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--gateware", "none.v"], "gateware none.v does not exist"),
        (["--gateware", "none"], "no gateware 'none': it takes a Verilog file"),
        (["--gateware", str(SYSTEM_CLOCK)], "pin CLK_50: found input of 1 bit, but the board has"),
        (["--gateware-param", "ROWS=3"], "gateware_param needs a design of your own"),
        (
            ["--gateware", str(WORKING["latch"]), "--gateware-param", "LINES=3"],
            "no parameter LINES; parameters: COLUMNS, ROWS",
        ),
        (["--gateware", str(WORKING["latch"]), "--engine", "python"], "does not run"),
    ],
)
def test_unusable_gateware_is_one_line(
    options: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    line = refused(capsys, *options)
    assert message in line
    told = [one for one in line.splitlines() if not one.startswith("measuring:")]
    assert len(told) <= 2  # a notice of the design may come first


def test_notices_name_the_latch(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["measure", "cubestar", "--frames", "1", "--gateware", str(WORKING["latch"])]) == 0
    assert "SRAM_D_O is a latch (latch.v:" in capsys.readouterr().err

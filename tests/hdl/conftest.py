"""Builds designs for Icarus Verilog and runs cocotb modules on them."""

import re
import shutil
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree

import pytest
from amaranth.lib.wiring import Component
from cocotb_tools.runner import Runner, get_runner

from cubestack.hdl.generate import verilog_text

HERE = Path(__file__).parent

# Registers start at X instead of the value that Verilog's initialisers give them: the real part
# has no such thing. Yosys' own helper signals keep theirs.
INITIALISER = re.compile(r"^(\s*reg (?:\[\d+:0\] )?[^$;=]*?) = \d+'h\w+;$", re.MULTILINE)

# A warning in a simulation's log. Icarus has no instances to iterate over, of which GPI warns.
WARNING = re.compile(r"WARNING +(?! |gpi +vpi_iterate returned NULL)|[Ww]arning:")


class Icarus:
    """Builds each design once, then runs any number of cocotb modules on it."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._built: dict[str, Runner] = {}
        self._runs = 0

    def run(
        self,
        design: type[Component],
        columns: int,
        rows: int,
        *modules: str,
        seed: int,
        harness: str | None = None,
        initialised: bool = True,
        text: Callable[[Component, str], str] = verilog_text,
    ) -> None:
        """Run the cocotb ``modules`` on ``design``, or on the Verilog file ``harness`` around it.

        ``text`` makes Verilog of the design, as module of the name that it is given.
        Fails with the names of the cocotb tests that failed and the end of their log.
        """
        print(f"{design.__name__} {columns}x{rows} COCOTB_RANDOM_SEED={seed}")
        top = harness or "dut"
        name = f"{design.__name__}-{columns}x{rows}-{top}-{initialised}-{text.__name__}"
        if name not in self._built:
            verilog = text(design(columns, rows), "dut")
            self._built[name] = self._build(name, verilog, columns, rows, top, initialised)
        self._runs += 1
        results = self._folder / f"{self._runs}.xml"
        log = self._folder / f"{self._runs}.log"
        with pytest.MonkeyPatch.context() as patch, suppress(SystemExit):
            patch.setattr(sys, "path", [str(HERE), *sys.path])
            self._built[name].test(
                test_module=modules,
                hdl_toplevel=top,
                seed=seed,
                plusargs=[f"+seed={seed}"],
                extra_env={"FRAME_COLUMNS": str(columns), "FRAME_ROWS": str(rows)},
                test_dir=self._folder / f"{self._runs}",
                results_xml=str(results),
                log_file=log,
            )
        text = log.read_text(encoding="utf-8", errors="replace")
        assert results.exists(), f"the simulation gave no results\n{text[-4000:]}"
        cases = list(ElementTree.parse(results).iter("testcase"))
        ran = {str(case.get("classname")).split(".")[-1] for case in cases}
        assert ran == set(modules), f"no test ran in {set(modules) - ran}"
        failed = [
            case.get("name")
            for case in cases
            if any(case.find(outcome) is not None for outcome in ("failure", "error", "skipped"))
        ]
        assert not failed, f"cocotb tests failed: {failed}\n{text[-6000:]}"
        warned = [line for line in text.splitlines() if WARNING.search(line)]
        assert not warned, "\n".join(warned)

    def _build(
        self,
        name: str,
        text: str,
        columns: int,
        rows: int,
        top: str,
        initialised: bool,
    ) -> Runner:
        folder = self._folder / name
        folder.mkdir()
        if not initialised:
            text, changed = INITIALISER.subn(r"\1;", text)
            assert changed
        (folder / "dut.v").write_text(text, encoding="utf-8")
        sources = [folder / "dut.v"]
        if top != "dut":
            sources.append(Path(shutil.copy(HERE / f"{top}.v", folder)))
        runner = get_runner("icarus")
        runner.build(
            sources=sources,
            parameters={"COLUMNS": columns, "ROWS": rows} if top != "dut" else {},
            hdl_toplevel=top,
            build_dir=folder,
            build_args=["-Wall", "-Wno-timescale"],
            timescale=("1ps", "1ps"),
            log_file=folder / "build.log",
        )
        warnings = (folder / "build.log").read_text(encoding="utf-8")
        assert not warnings, warnings
        return runner


@pytest.fixture(scope="session")
def icarus(tmp_path_factory: pytest.TempPathFactory) -> Icarus:
    if shutil.which("iverilog") is None:
        pytest.fail("Icarus Verilog is needed: apt-get install iverilog")
    return Icarus(tmp_path_factory.mktemp("icarus"))

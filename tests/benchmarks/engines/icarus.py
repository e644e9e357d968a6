"""A workload's sample in cocotb on Icarus Verilog.

The child process of this module builds and runs it, because cocotb's runner changes its
process' environment and prints what it does.
"""

import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from cubestack.emulator.rtl.wiring import MEMORY_PINS
from cubestack.hdl.flow.generate import verilog_text
from tests.benchmarks.engines.workloads import Workload

#: The project's folder, from which this module has its name.
ROOT = Path(__file__).parents[3]


class CocotbError(RuntimeError):
    """The simulation failed."""


def missing_for_cocotb() -> str | None:
    """What to install for :func:`run_cocotb`, or None."""
    if importlib.util.find_spec("cocotb") is None:
        return "pip install cocotb"
    if shutil.which("iverilog") is None:
        return "Icarus Verilog (apt-get install iverilog)"
    return None


def run_cocotb(workload: Workload, lines: int) -> float:
    """Seconds of processor time for a sample, without starting the simulator.

    CocotbError with the last line of its log when it fails.
    """
    wiring = workload.wiring()
    cameras = workload.cameras()
    setup = {
        "initial": wiring.initial,
        "levels": workload.levels,
        "cameras": [
            {name: getattr(pins, name) for name in ("name", "clock", "data", "line", "frame")}
            for pins in wiring.cameras
        ],
        "memories": {
            memory.name: {pin: memory[pin] for pin in MEMORY_PINS} for memory in wiring.memories
        },
        "half_ps": 10**12 // (2 * workload.clock_hz),
        "clocks": workload.clocks(lines) // len(cameras),
        "blank_clocks": workload.blank_clocks,
        "line_clocks": workload.line_clocks,
    }
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "top.v").write_text(verilog_text(wiring.component))
        arrays: dict[str, Any] = {camera: source.image for camera, source in cameras.items()}
        np.savez(folder / "sample.npz", **arrays, setup=np.array(json.dumps(setup)))
        done = subprocess.run(
            [sys.executable, "-m", __name__, name],
            cwd=ROOT,
            env={**os.environ, "CUBESTACK_SAMPLE": name, "NO_COLOR": "1"},
            capture_output=True,
            text=True,
        )
        if not (folder / "result.npz").exists():
            log = (done.stdout + done.stderr).strip() or "no word"
            raise CocotbError(f"cocotb on Icarus Verilog failed: {log.splitlines()[-1]}")
        result = np.load(folder / "result.npz")
        workload.check(lines, {memory.name: result[memory.name] for memory in wiring.memories})
        return float(result["seconds"])


def _main(folder: Path) -> None:
    from cocotb_tools.runner import get_runner

    runner = get_runner("icarus")
    runner.build(
        sources=[folder / "top.v"], hdl_toplevel="top", build_dir=folder, timescale=("1ps", "1ps")
    )
    runner.test(
        hdl_toplevel="top",
        test_module="tests.benchmarks.engines.stimulus",
        build_dir=folder,
        test_dir=folder,
    )


if __name__ == "__main__":
    _main(Path(sys.argv[1]))

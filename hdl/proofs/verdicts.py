"""Runs a table of proofs and reports their outcome."""

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from cubestack.hdl.proofs.prover import Proof, ProofResult, prove


class ProofVerdict(NamedTuple):
    """Outcome of a proof, and of the same with a fault planted."""

    name: str
    proof: Proof
    result: ProofResult
    planted: ProofResult

    @property
    def good(self) -> bool:
        """True if the property is proved and the planted fault refutes it."""
        return self.result.proved and self.planted.counterexample


def verdicts(proofs: Mapping[str, Proof]) -> Iterator[ProofVerdict]:
    for name, proof in proofs.items():
        yield ProofVerdict(name, proof, prove(proof), prove(proof, planted=True))


def verdict_text(verdict: ProofVerdict) -> str:
    name, proof, result, planted = verdict
    seconds = f"{result.seconds + planted.seconds:.1f} s"
    outcome = f"proved, induction over {result.steps}" if result.proved else "NOT PROVED"
    if result.counterexample:
        outcome = f"REFUTED after {result.steps} steps"
    found = f"found after {planted.steps} steps" if planted.counterexample else "NOT FOUND"
    fault = proof.fault
    return (
        f"{name}: {proof.property}\n"
        f"  {outcome}; planted bug ({fault.wire} stuck at {fault.level}) {found}; {seconds}"
    )


def verdict_json(done: Iterable[ProofVerdict]) -> str:
    return json.dumps(
        {
            verdict.name: {
                "property": verdict.proof.property,
                "good": verdict.good,
                "proof": verdict.result._asdict(),
                "fault": verdict.proof.fault._asdict(),
                "planted": verdict.planted._asdict(),
            }
            for verdict in done
        },
        indent=1,
    )

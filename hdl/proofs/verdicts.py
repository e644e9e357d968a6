"""Running a table of proofs one after the other, and telling how they ended."""

import json
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from cubestack.hdl.proofs.prover import Proof, ProofResult, prove


class Verdict(NamedTuple):
    """What became of a proof, and of the same with a fault planted."""

    name: str
    proof: Proof
    result: ProofResult
    planted: ProofResult

    @property
    def good(self) -> bool:
        """Whether the property is proved, and the fault refutes it."""
        return self.result.proved and self.planted.counterexample


def verdicts(proofs: Mapping[str, Proof]) -> Iterator[Verdict]:
    """Try each, by name."""
    for name, proof in proofs.items():
        yield Verdict(name, proof, prove(proof), prove(proof, planted=True))


def verdict_text(verdict: Verdict) -> str:
    """Two lines for a reader."""
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


def verdict_json(done: Iterable[Verdict]) -> str:
    """For another program."""
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

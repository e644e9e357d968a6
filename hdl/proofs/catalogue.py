"""All proofs by name, and running them one after the other."""

import json
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from cubestack.hdl.proofs.cubesense import i2c as cubesense_i2c
from cubestack.hdl.proofs.cubesense import pair as cubesense
from cubestack.hdl.proofs.cubestar import published as cubestar
from cubestack.hdl.proofs.cubestar import successors as cubestar_next
from cubestack.hdl.proofs.prover import Outcome, prove

__all__ = ["PROOFS", "Verdict", "verdict_json", "verdict_text", "verdicts"]

PROOFS = cubestar.PROOFS | cubestar_next.PROOFS | cubesense.PROOFS | cubesense_i2c.PROOFS


class Verdict(NamedTuple):
    """A proof, and the same with a fault planted."""

    name: str
    proof: Outcome
    planted: Outcome

    @property
    def good(self) -> bool:
        """Whether the claim is proved, and the fault refutes it."""
        return self.proof.proved and self.planted.counterexample


def verdicts(names: Iterable[str]) -> Iterator[Verdict]:
    """Try each of these of PROOFS."""
    for name in names:
        yield Verdict(name, prove(PROOFS[name]), prove(PROOFS[name], planted=True))


def verdict_text(verdict: Verdict) -> str:
    """Two lines for a reader."""
    name, proof, planted = verdict
    seconds = f"{proof.seconds + planted.seconds:.1f} s"
    outcome = f"proved, induction over {proof.steps}" if proof.proved else "NOT PROVED"
    if proof.counterexample:
        outcome = f"REFUTED after {proof.steps} steps"
    found = f"found after {planted.steps} steps" if planted.counterexample else "NOT FOUND"
    fault = PROOFS[name].fault
    return (
        f"{name}: {PROOFS[name].claim}\n"
        f"  {outcome}; planted bug ({fault.wire} stuck at {fault.level}) {found}; {seconds}"
    )


def verdict_json(done: Iterable[Verdict]) -> str:
    """For another program."""
    return json.dumps(
        {
            verdict.name: {
                "claim": PROOFS[verdict.name].claim,
                "good": verdict.good,
                "proof": verdict.proof._asdict(),
                "fault": PROOFS[verdict.name].fault._asdict(),
                "planted": verdict.planted._asdict(),
            }
            for verdict in done
        },
        indent=1,
    )

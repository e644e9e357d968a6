"""The differences between two runs of the protocol suite.

Of telemetry, settings and identity are compared. Counters, error flags and results of measurements
depend on what a device has done; of these only the form is checked, by each run.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from cubestack.host.conformance.contract import TIMES_CHECK, CheckResult, CheckRun, Verdict


class Kind(Enum):
    """How two targets differ in a check."""

    OUTCOME = "another outcome"
    VALUE = "another value"
    MISSING = "not checked on both"


@dataclass(frozen=True)
class Difference:
    """A check with different results on two targets."""

    kind: Kind
    check: str  #: its name
    here: str  #: result on the first target; empty if it is not checked there
    there: str  #: on the second one


def compare(first: CheckRun, second: CheckRun) -> list[Difference]:
    """All differences between two runs, by kind; skipped checks and times are none."""
    others = {check.name: check for check in second.checks}
    names = {check.name for check in first.checks}
    ignored = _ignored(first)
    found = [_differences(check, others.get(check.name), ignored) for check in first.checks]
    found += [
        _differences(None, check, ignored) for check in second.checks if check.name not in names
    ]
    differences = [one for one in found if one is not None]
    return sorted(differences, key=lambda one: list(Kind).index(one.kind))


def _ignored(run: CheckRun) -> set[str]:
    """Fields that are not compared, as "telemetry Frame.Field"."""
    return {
        f"telemetry {frame.name}.{field.name}"
        for frame in run.target.interface.telemetries
        for field in frame.fields
        if field.counter
        or field.flag
        or run.notes.results & {frame.name, f"{frame.name}.{field.name}"}
    }


def _compared(check: CheckResult, ignored: set[str]) -> list[str]:
    return [one for one in check.observed if f"{check.name}.{one.partition('=')[0]}" not in ignored]


def _differences(
    here: CheckResult | None, there: CheckResult | None, ignored: set[str]
) -> Difference | None:
    either = [check for check in (here, there) if check is not None]
    name = either[0].name
    if name == TIMES_CHECK or any(check.verdict is Verdict.SKIPPED for check in either):
        return None
    if here is None or there is None:
        return Difference(Kind.MISSING, name, _outcome(here), _outcome(there))
    if here.verdict is not there.verdict:
        return Difference(Kind.OUTCOME, name, _outcome(here), _outcome(there))
    values = _compared(here, ignored), _compared(there, ignored)
    return Difference(Kind.VALUE, name, *_unequal(*values)) if values[0] != values[1] else None


def _outcome(check: CheckResult | None) -> str:
    if check is None:
        return ""
    reason = f": {check.detail}" if check.verdict is Verdict.FAILED else ""
    return check.verdict.value + reason


def _unequal(here: Sequence[str], there: Sequence[str]) -> tuple[str, str]:
    """The observations that only one of both has, in order."""
    return (
        ", ".join(one for one in here if one not in there) or "nothing",
        ", ".join(one for one in there if one not in here) or "nothing",
    )


def table(differences: Sequence[Difference], here: str, there: str) -> list[str]:
    """Lines of text: each kind's name with its differences; one line if nothing differs."""
    if not differences:
        return [f"{here} and {there} do not differ"]
    lines = [f"{len(differences)} differences between {here} (<) and {there} (>)"]
    for kind in Kind:
        of_kind = [one for one in differences if one.kind is kind]
        if of_kind:
            lines.append(f"{kind.value}: {len(of_kind)}")
        for one in of_kind:
            lines.append(f"  {one.check}")
            lines += [
                f"    {mark} {text}" for mark, text in (("<", one.here), (">", one.there)) if text
            ]
    return lines

"""The protocol suite: what a device answers beside what its interface tables declare.

Every declared telemetry frame, telecommand, register and bench letter is walked, and every error
path: lengths, ranges, effects by reading them back, times. What may change a device, and that are
all telecommands, even such as must be refused, is left out unless writing is allowed.
"""

from collections.abc import Callable

from cubestack.host.conformance.contract import CheckResult, CheckRun
from cubestack.host.conformance.reads import check_reads
from cubestack.host.conformance.writes import check_writes
from cubestack.host.devices.device import ConformanceNotes
from cubestack.host.targets import Target


def run_suite(
    target: Target,
    allow_write: bool = False,
    on_check: Callable[[CheckResult], None] = lambda _check: None,
) -> CheckRun:
    """Run everything on ``target``; raises TransportError when the connection ends.

    Without ``allow_write``, what may change the device is left out. ``on_check`` gets each result
    as it comes.
    """
    notes = ConformanceNotes() if target.device is None else target.device.conformance
    run = CheckRun(target, allow_write, notes, on_check=on_check)
    check_reads(run)
    check_writes(run)
    return run


def compare(first: CheckRun, second: CheckRun) -> str | None:
    """The first difference between two runs, in words; None without any."""
    others = {check.name: check for check in second.checks}
    one, other = first.target.name, second.target.name
    for check in first.checks:
        found = others.get(check.name)
        if found is None:
            return f"{check.name}: only on {one}"
        if check.verdict is not found.verdict:
            return (
                f"{check.name}: {check.verdict.value} on {one}, {found.verdict.value} on {other} "
                f"({found.detail or check.detail})"
            )
        for here, there in zip(check.observed, found.observed, strict=False):
            if here != there:
                return f"{check.name}: {here} on {one}, {there} on {other}"
        if len(check.observed) != len(found.observed):
            return f"{check.name}: {len(check.observed)} values on {one}, not on {other}"
    return None

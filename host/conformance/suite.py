"""The protocol suite: a device's answers against its interface tables.

It checks every declared telemetry frame, telecommand, register and bench letter, and every error
path: lengths, ranges, effects read back, times. Without permission to write it skips everything
that could change the device: all telecommands, even invalid ones.
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
    """Run all checks on ``target``; raises TransportError if the connection ends.

    ``on_check`` is called with each result.
    """
    notes = ConformanceNotes() if target.device is None else target.device.conformance
    run = CheckRun(target, allow_write, notes, on_check=on_check)
    check_reads(run)
    check_writes(run)
    return run


def compare(first: CheckRun, second: CheckRun) -> str | None:
    """The first difference between two runs in words, or None."""
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

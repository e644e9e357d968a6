"""The protocol suite: what a device answers beside what its interface tables declare.

Every declared telemetry frame, telecommand, register and bench letter is walked, and every error
path: lengths, ranges, effects by reading them back, times. What may change a device, and that are
all telecommands, even such as must be refused, is left out unless writing is allowed. The sources
leave the times open: an answer is late when it keeps a host waiting for longer than real hosts'
poll period beside its own time on the wire.
"""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum

from cubestack.firmware_model.interface.codec.message import Message, Value
from cubestack.host.clients.node import NodeClient
from cubestack.host.devices.targets import Target
from cubestack.host.errors import NodeError
from cubestack.host.shell.names import has_side_effect

__all__ = ["Check", "Outcome", "Suite", "compare"]

LATE_S = 0.04
"""What an answer may take beside its time on the wire: the poll period of real hosts."""

ATTEMPTS = 3
BITS_PER_BYTE = 10
FRAMING_BYTES = 4
I2C_HZ = 100_000  # standard mode: a host does not know better
I2C_BITS_PER_BYTE = 9
I2C_OVERHEAD_BYTES = 3  # two addresses and the ID

MEASURED_UNITS = {"s", "ms", "us", "mA", "C", "deg C", "degC"}
"""Units of fields whose values two devices need not share."""


class Outcome(Enum):
    """What became of a check."""

    PASSED = "passed"
    FAILED = "failed"
    SKIPPED = "skipped"


@dataclass
class Check:
    """One check.

    Attributes:
        name: unique within a run.
        outcome: what became of it.
        detail: why it failed or was skipped; else what was seen.
        observed: what two targets are compared by.
    """

    name: str
    outcome: Outcome
    detail: str = ""
    observed: tuple[str, ...] = ()


class FailedError(Exception):
    """A check failed; the text says what was seen and what is declared."""


class PassedError(Exception):
    """A check passed; the text says what was seen, and is not compared."""


class SkippedError(Exception):
    """A check does not apply; the text says why."""


@dataclass
class Suite:
    """Runs checks on one target.

    Attributes:
        target: what is checked.
        allow_write: whether the device may be changed.
        checks: those that have run.
        on_check: called with each one as it ends.
        latencies_s: times of answers beside their time on the wire, by telemetry frame.
    """

    target: Target
    allow_write: bool = False
    checks: list[Check] = field(default_factory=list)
    on_check: Callable[[Check], None] = lambda _check: None
    latencies_s: dict[str, float] = field(default_factory=dict)

    def run(self) -> list[Check]:
        """Run everything; raises TransportError when the connection ends."""
        from cubestack.host.conformance.reads import check_reads
        from cubestack.host.conformance.writes import check_writes

        check_reads(self)
        check_writes(self)
        return self.checks

    @property
    def failed(self) -> int:
        """Number of checks that failed."""
        return sum(check.outcome is Outcome.FAILED for check in self.checks)

    @contextmanager
    def check(self, name: str) -> Iterator[list[str]]:
        """The block is a check; it may append to the list what it observes."""
        seen: list[str] = []
        result = Check(name, Outcome.PASSED)
        try:
            yield seen
            result.detail = ", ".join(seen)
        except PassedError as what:
            result.detail = str(what)
        except SkippedError as reason:
            result.outcome, result.detail = Outcome.SKIPPED, str(reason)
        except (FailedError, NodeError) as reason:
            result.outcome, result.detail = Outcome.FAILED, str(reason)
        result.observed = tuple(seen)
        self._add(result)

    def writing(self, name: str, body: Callable[[list[str]], None]) -> None:
        """A check that changes the device: ``body`` runs where that is allowed."""
        if self.may_write(name):
            with self.check(name) as seen:
                body(seen)

    def may_write(self, name: str) -> bool:
        """Whether check ``name``, which changes the device, may run; else it is left out."""
        if not self.allow_write:
            reason = "changes the device: needs --allow-write"
            self._add(Check(name, Outcome.SKIPPED, reason))
        return self.allow_write

    def _add(self, result: Check) -> None:
        self.checks.append(result)
        self.on_check(result)

    def request(self, payload: bytes) -> bytes | None:
        """Any payload in a frame; SkippedError where there are no frames."""
        node = self.target.node
        if not isinstance(node, NodeClient):
            raise SkippedError("needs a serial line")
        return node.request(payload)

    def telemetry(self, message: Message) -> dict[str, Value]:
        """A telemetry frame, its time taken: the best of three, as hosts have hiccups."""
        values, latency_s = self._timed(message)
        for _ in range(ATTEMPTS - 1):
            if latency_s <= LATE_S or has_side_effect(message):
                break
            latency_s = min(latency_s, self._timed(message)[1])
        self.latencies_s[message.name] = latency_s
        return values

    def _timed(self, message: Message) -> tuple[dict[str, Value], float]:
        start_s = self.now_s()
        values = self.target.node.telemetry(message.name)
        if isinstance(self.target.node, NodeClient):
            frames = 2 * FRAMING_BYTES + 1 + message.length
            wire_s = frames * BITS_PER_BYTE / self.target.interface.baud
        else:
            wire_s = (I2C_OVERHEAD_BYTES + message.length) * I2C_BITS_PER_BYTE / I2C_HZ
        return values, max(0.0, self.now_s() - start_s - wire_s)

    def now_s(self) -> float:
        """The device's time where it is emulated here, else the wall's."""
        controls = self.target.controls
        return time.monotonic() if controls is None else controls.time_s()


def show_values(message: Message, values: Mapping[str, Value]) -> list[str]:
    """Values that two devices of one kind should share, as FIELD=VALUE."""
    return [
        f"{f.name}={f.label(values[f.name])}"
        for f in message.fields
        if f.unit not in MEASURED_UNITS
    ]


def compare(first: Suite, second: Suite) -> str | None:
    """The first difference between two runs, in words; None without any."""
    others = {check.name: check for check in second.checks}
    one, other = first.target.name, second.target.name
    for check in first.checks:
        found = others.get(check.name)
        if found is None:
            return f"{check.name}: only on {one}"
        if check.outcome is not found.outcome:
            return (
                f"{check.name}: {check.outcome.value} on {one}, {found.outcome.value} on {other} "
                f"({found.detail or check.detail})"
            )
        for here, there in zip(check.observed, found.observed, strict=False):
            if here != there:
                return f"{check.name}: {here} on {one}, {there} on {other}"
        if len(check.observed) != len(found.observed):
            return f"{check.name}: {len(check.observed)} values on {one}, not on {other}"
    return None

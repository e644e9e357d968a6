"""What the protocol suite's checks are made of: a run on one target and its results.

The sources leave the times of answers open: one is late when it keeps a host waiting for longer
than real hosts' poll period beside its own time on the wire.
"""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum

from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.host.clients.node import NodeClient
from cubestack.host.clients.registers import RegisterClient
from cubestack.host.devices.device import ConformanceNotes
from cubestack.host.errors import NoAnswerError, NodeError
from cubestack.host.targets import Target

LATE_S = 0.04
"""What an answer may take beside its time on the wire: the poll period of real hosts."""

ATTEMPTS = 3
BITS_PER_BYTE = 10
FRAMING_BYTES = 4
I2C_HZ = 100_000  # standard mode: a host does not know better
I2C_BITS_PER_BYTE = 9
I2C_OVERHEAD_BYTES = 3  # two addresses and the ID

PROCESSING_TIMEOUT_S = 15.0
RESTART_TIMEOUT_S = 10.0
RESTART_POLL_S = 0.25


class Verdict(Enum):
    """What became of a check."""

    PASSED = "passed"
    FAILED = "failed"
    SKIPPED = "skipped"


@dataclass
class CheckResult:
    """One check that has run, or was left out.

    Attributes:
        name: unique within a run.
        verdict: what became of it.
        detail: why it failed or was skipped; else what was seen.
        observed: what two targets are compared by.
    """

    name: str
    verdict: Verdict
    detail: str = ""
    observed: tuple[str, ...] = ()


class FailedError(Exception):
    """A check failed; the text says what was seen and what is declared."""


class PassedError(Exception):
    """A check passed; the text says what was seen, and is not compared."""


class SkippedError(Exception):
    """A check does not apply; the text says why."""


@dataclass
class CheckRun:
    """A run of checks on one target.

    Attributes:
        target: what is checked.
        allow_write: whether the device may be changed.
        notes: what must be known of the device beside its tables.
        checks: those that have run.
        on_check: called with each one as it ends.
        latencies_s: times of answers beside their time on the wire, by telemetry frame.
    """

    target: Target
    allow_write: bool = False
    notes: ConformanceNotes = field(default_factory=ConformanceNotes)
    checks: list[CheckResult] = field(default_factory=list)
    on_check: Callable[[CheckResult], None] = lambda _check: None
    latencies_s: dict[str, float] = field(default_factory=dict)

    @property
    def failed(self) -> int:
        return sum(check.verdict is Verdict.FAILED for check in self.checks)

    @property
    def registers(self) -> RegisterClient:
        """Client of the registers; SkippedError where they are not within reach."""
        if self.target.registers is None:
            raise SkippedError("no I2C bus within reach")
        return self.target.registers

    @contextmanager
    def check(self, name: str) -> Iterator[list[str]]:
        """The block is a check; it may append to the list what it observes."""
        seen: list[str] = []
        result = CheckResult(name, Verdict.PASSED)
        try:
            yield seen
            result.detail = ", ".join(seen)
        except PassedError as what:
            result.detail = str(what)
        except SkippedError as reason:
            result.verdict, result.detail = Verdict.SKIPPED, str(reason)
        except (FailedError, NodeError) as reason:
            result.verdict, result.detail = Verdict.FAILED, str(reason)
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
            self._add(CheckResult(name, Verdict.SKIPPED, reason))
        return self.allow_write

    def _add(self, result: CheckResult) -> None:
        self.checks.append(result)
        self.on_check(result)

    @property
    def node(self) -> NodeClient:
        """Client on a serial line; SkippedError where there is none."""
        if not isinstance(self.target.node, NodeClient):
            raise SkippedError("needs a serial line")
        return self.target.node

    def perform(self, name: str, values: Mapping[str, object]) -> None:
        """Send a telecommand and wait until it is processed; after a restart, for an answer."""
        node = self.target.node
        node.command(name, **values)
        try:
            node.wait_processed(PROCESSING_TIMEOUT_S)
        except NoAnswerError:
            for _ in range(int(RESTART_TIMEOUT_S / RESTART_POLL_S)):
                try:
                    node.telemetry(self.target.interface.telemetries[0].name)
                    return
                except NodeError:
                    node.pause(RESTART_POLL_S)
            raise FailedError(f"no answer for {RESTART_TIMEOUT_S:g} s after {name}") from None

    def expect_error(self, payload: bytes, error: str, what: str) -> None:
        """A frame with ``payload`` is acknowledged with ``error``, else ``what`` has failed."""
        codes = self.target.interface.ack_errors
        answer = self.node.request(payload)
        if answer is None:
            raise FailedError(f"{what}: no acknowledge, declared {error}")
        if answer != bytes([codes[error]]):
            known = {int(code): code.name for code in codes}
            name = known.get(answer[0], "unknown") if len(answer) == 1 else "no error code"
            found = f"acknowledged with {answer.hex()} ({name})"
            raise FailedError(f"{what}: {found}, declared {error}")

    def telemetry(self, message: Message) -> dict[str, Value]:
        """A telemetry frame, its time taken: the best of three, as hosts have hiccups."""
        values, latency_s = self._timed(message)
        for _ in range(ATTEMPTS - 1):
            if latency_s <= LATE_S or message.has_side_effect:
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

"""The checks of the protocol suite: a run on one target, its results, and the values to try.

The sources don't specify answer times. An answer is late if, without its time on the wire, it takes
longer than real hosts' poll period.
"""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from enum import Enum

from cubestack.firmware_model.interface.codec.field import Field, InterfaceError, Value
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.host.clients.node import NodeClient
from cubestack.host.clients.registers import RegisterClient
from cubestack.host.devices.device import ConformanceNotes
from cubestack.host.errors import NoAnswerError, NodeError
from cubestack.host.targets import Target

LATE_S = 0.04
"""Allowed time of an answer without its time on the wire: the poll period of real hosts."""

TIMES_CHECK = "times of answers"
ATTEMPTS = 3
BITS_PER_BYTE = 10
FRAMING_BYTES = 4
I2C_HZ = 100_000  # standard mode, the safe assumption of a host
I2C_BITS_PER_BYTE = 9
I2C_OVERHEAD_BYTES = 3  # two addresses and the ID

PROCESSING_TIMEOUT_S = 15.0
RESTART_TIMEOUT_S = 10.0
RESTART_POLL_S = 0.25


class Verdict(Enum):
    """Result of a check."""

    PASSED = "passed"
    FAILED = "failed"
    SKIPPED = "skipped"


@dataclass
class CheckResult:
    """A check that ran or was skipped."""

    name: str  #: unique within a run
    verdict: Verdict  #: its result
    detail: str = ""  #: why it failed or was skipped, or what was observed
    observed: tuple[str, ...] = ()  #: values by which two targets are compared


class FailedError(Exception):
    """A check failed; the text has the observed and the declared value."""


class PassedError(Exception):
    """A check passed; the text has the observation, which is not compared."""


class SkippedError(Exception):
    """A check does not apply; the text says why."""


@dataclass
class CheckRun:
    """A run of checks on one target."""

    target: Target  #: what is checked
    allow_write: bool = False  #: whether checks may change the device
    #: the device's conformance notes
    notes: ConformanceNotes = field(default_factory=ConformanceNotes)
    checks: list[CheckResult] = field(default_factory=list)  #: results so far
    on_check: Callable[[CheckResult], None] = lambda _check: None  #: called with each result
    #: answer times without the time on the wire, by telemetry frame
    latencies_s: dict[str, float] = field(default_factory=dict)

    @property
    def failed(self) -> int:
        return sum(check.verdict is Verdict.FAILED for check in self.checks)

    @property
    def registers(self) -> RegisterClient:
        """Client of the registers; raises SkippedError without access to them."""
        if self.target.registers is None:
            raise SkippedError("no I2C bus available")
        return self.target.registers

    @contextmanager
    def check(self, name: str) -> Iterator[list[str]]:
        """Run the block as a check; it may append observations to the list."""
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
        """A check that changes the device: ``body`` runs if that is allowed."""
        if self.may_write(name):
            with self.check(name) as seen:
                body(seen)

    def may_write(self, name: str) -> bool:
        """Whether check ``name``, which changes the device, may run; else skips it."""
        if not self.allow_write:
            reason = "changes the device: needs --allow-write"
            self._add(CheckResult(name, Verdict.SKIPPED, reason))
        return self.allow_write

    def _add(self, result: CheckResult) -> None:
        self.checks.append(result)
        self.on_check(result)

    @property
    def node(self) -> NodeClient:
        """Client on a serial line; raises SkippedError without one."""
        if not isinstance(self.target.node, NodeClient):
            raise SkippedError("needs a serial line")
        return self.target.node

    def perform(self, name: str, values: Mapping[str, object]) -> None:
        """Send a telecommand and wait until it is processed, or for an answer after a restart."""
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
        """Fail ``what`` unless a frame with ``payload`` is acknowledged with ``error``."""
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
        """A telemetry frame, timed: best of three, since hosts have delays."""
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
        """The device's virtual time if emulated here, else wall time."""
        controls = self.target.controls
        return time.monotonic() if controls is None else controls.time_s()


def values_to_try(message: Message) -> Iterator[dict[str, Value]]:
    """Allowed values of all fields: reset, smallest, largest, in between, single ones."""
    reset = message.reset_values()
    candidates = [reset]
    for share in (0.0, 1.0, 0.5):
        values: dict[str, Value] = {}
        for one in message.fields:
            low, high = limits_of(one)
            value = low + share * (high - low)
            integer = one.type != "f32" and one.scale == 1
            values[one.name] = int(value) if integer else value
        candidates.append(values)
    floats = [one.name for one in message.fields if one.type == "f32"]
    candidates += [reset | {name: 1.0} for name in floats]  # unit vectors among them
    seen = []
    for values in candidates:
        try:
            carried = message.unpack(message.pack(**values))
        except InterfaceError:
            continue
        if not message.violations(carried) and carried not in seen:
            seen.append(carried)
            yield carried


def limits_of(one: Field) -> tuple[float, float]:
    if one.choices is not None:
        values = [int(choice) for choice in one.choices]
        return min(values), max(values)
    if one.type.startswith("bytes"):
        return 0, 0
    low, high = (0.0, 1.0) if one.type == "f32" else _raw_limits(one)
    least, most = one.ends
    return (low if least is None else least, high if most is None else most)


def _raw_limits(one: Field) -> tuple[float, float]:
    low, high = one.raw_range
    return low / one.scale, high / one.scale


def violations(message: Message) -> Iterator[tuple[Field, bytes]]:
    """For each field with limits: the field, and parameters with only this field out of range."""
    reset = message.reset_values()
    for one in message.fields:
        if one.type.startswith("bytes"):
            continue
        tries: list[float] = []
        if one.type == "f32":
            tries.append(float("nan"))
        else:
            tries += _raw_limits(one)
        low, high = limits_of(one)
        tries += [low - 1 / one.scale, high + 1 / one.scale]
        for value in reversed(tries):
            try:
                data = message.pack(**(reset | {one.name: value}))
            except (InterfaceError, ValueError, OverflowError):
                continue
            if one in [wrong for wrong, _ in message.violations(message.unpack(data))]:
                yield one, data
                break

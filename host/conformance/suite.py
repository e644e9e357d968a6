"""The protocol suite: a device's answers against its interface tables.

It checks every declared telemetry frame, telecommand, register and bench letter, and every error
path: lengths, ranges, effects read back, times. Without permission to write it skips everything
that could change the device: all telecommands, even invalid ones.
"""

from collections.abc import Callable
from statistics import median

from cubestack.firmware_model.interface.codec.frames import END, ESCAPE, START
from cubestack.firmware_model.interface.codec.message import TELEMETRY_BIT, Message
from cubestack.firmware_model.interface.codec.register_pointer import FILL, PointerMap
from cubestack.host.conformance import contract
from cubestack.host.conformance.contract import CheckResult, CheckRun, FailedError
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


UNKNOWN_SAMPLES = 3
"""Number of unknown telemetry IDs to try: each costs a time-out."""


MEASURED_UNITS = {"s", "ms", "us", "mA", "C", "deg C", "degC"}
"""Units of fields that may differ between two devices."""


def check_reads(run: CheckRun) -> None:
    for message in run.target.interface.telemetries:
        if message.supported:
            _check_telemetry(run, message)
    _check_unknown(run)
    _check_framing(run)
    registers = run.target.interface.registers
    if registers is not None:
        _check_registers(run, registers)
    _check_times(run)


def _check_telemetry(run: CheckRun, message: Message) -> None:
    name = f"telemetry {message.name}"
    if message.starts_measurement and not run.may_write(name):
        return
    with run.check(name) as seen:
        values = run.telemetry(message)  # raises unless it has the declared length
        seen += [
            f"{f.name}={f.label(values[f.name])}"
            for f in message.fields
            if f.unit not in MEASURED_UNITS
        ]
        for field, _ in message.violations(values):
            found = field.label(values[field.name])
            raise FailedError(f"field {field.name} is {found}: not allowed")
        version = run.target.interface.version
        if values.get("InterfaceVersion", version) != version:
            found = message.field("InterfaceVersion").label(values["InterfaceVersion"])
            raise FailedError(f"InterfaceVersion is {found}, declared {version}")


def _check_unknown(run: CheckRun) -> None:
    declared = {message.id for message in run.target.interface.messages if message.supported}
    unknown = [i for i in range(TELEMETRY_BIT, 256) if i not in declared]
    step = max(1, len(unknown) // UNKNOWN_SAMPLES)
    for identifier in unknown[::step][:UNKNOWN_SAMPLES]:
        with run.check(f"unknown telemetry ID {identifier}") as seen:
            answer = run.node.request(bytes([identifier]))
            if answer is not None:
                raise FailedError(f"answered with {answer.hex() or 'nothing in a frame'}")
            seen.append("no answer")


def _check_framing(run: CheckRun) -> None:
    message = run.target.interface.telemetries[0]
    whole = bytes([ESCAPE, START, message.id, ESCAPE, END])
    cases = {
        "noise before a frame": bytes([0x00, 0x55, 0xAA]) + whole,
        "start within a frame": bytes([ESCAPE, START, 0x01]) + whole,
        "escape that means nothing": bytes([ESCAPE, START, ESCAPE, 0x01]) + whole,
        "end without a start": bytes([ESCAPE, END]) + whole,
    }
    for name, wire in cases.items():
        with run.check(f"framing: {name}") as seen:
            _expect(run, wire, message)
            seen.append("found again")
    with run.check("framing: frame in two pieces") as seen:
        _expect(run, whole[:3], message, whole[3:])
        seen.append("answered")


def _expect(run: CheckRun, wire: bytes, message: Message, rest: bytes = b"") -> None:
    """The node answers the request in ``wire``, with ``rest`` sent separately."""
    answer = run.node.exchange(wire, rest)
    if answer is None or len(answer) != message.length:
        found = "no answer" if answer is None else f"an answer of {len(answer)} bytes"
        raise FailedError(f"{found} to telemetry {message.name}")


def _check_registers(run: CheckRun, registers: PointerMap) -> None:
    for register in registers:
        if not register.readable or register.streams:
            continue
        with run.check(f"register {register.name}") as seen:
            value = run.registers.read(register.name)
            seen.append(register.field.label(value))
            if not register.field.allows(value, {}):
                raise FailedError(f"{register.field.label(value)} is not allowed")
    unused = next(address for address in range(255, -1, -1) if registers.at(address) is None)
    with run.check(f"register address {unused:#04x} without a register") as seen:
        try:
            data = run.registers.read_raw(unused, 2)
        except TimeoutError as error:
            if not run.registers.on_line:
                raise FailedError(f"no answer: {error}") from None
            seen.append("no answer")
            return
        seen.append(data.hex())
        if run.registers.on_line:
            raise FailedError(f"read {data.hex()}, declared no answer")
        if data != bytes([FILL, FILL]):
            raise FailedError(f"read {data.hex()}, declared {FILL:#04x} in each byte")


def _check_times(run: CheckRun) -> None:
    with run.check(contract.TIMES_CHECK):
        if not run.latencies_s:
            raise contract.SkippedError("no telemetry request was answered")
        slowest = max(run.latencies_s, key=lambda name: run.latencies_s[name])
        worst_ms = 1000 * run.latencies_s[slowest]
        middle_ms = 1000 * median(run.latencies_s.values())
        text = f"median {middle_ms:.1f} ms, {slowest} {worst_ms:.1f} ms without the wire"
        if worst_ms > 1000 * contract.LATE_S:
            raise FailedError(f"{text}: more than {1000 * contract.LATE_S:g} ms")
        raise contract.PassedError(text)

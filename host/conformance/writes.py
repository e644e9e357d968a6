"""Checks that change the device: telecommands, their errors and effects, registers, bench letters.

A setting that can be read back is put back to what it was.
"""

from collections.abc import Mapping
from functools import partial

from cubestack.firmware_model.interface.codec.field import Field, Value
from cubestack.firmware_model.interface.codec.letters import BenchProtocol, Letter
from cubestack.firmware_model.interface.codec.message import TELEMETRY_BIT, Message
from cubestack.firmware_model.interface.codec.register_pointer import PointerRegister
from cubestack.host.conformance.actions import perform
from cubestack.host.conformance.suite import FailedError, SkippedError, Suite
from cubestack.host.conformance.tasks import TASKS
from cubestack.host.conformance.values import (
    keys_of,
    limits_of,
    read_back,
    values_to_try,
    violations,
)
from cubestack.host.errors import CommandRefusedError
from cubestack.host.transport.streams import Transport

__all__ = ["check_writes"]

BENCH_TIMEOUT_S = 3.0
BENCH_READ_BYTES = 4096

#: Settings of which some values need an option of the hardware; without it they are refused.
OPTIONAL = {"SetNadirSearch", "NADIR_SEARCH"}

#: What ends a mode that a telecommand starts.
ENDED_BY = {"Trigger": "StopLoop", "StartLoop": "StopLoop"}


def check_writes(suite: Suite) -> None:
    """Run them all; without permission each is reported as left out."""
    interface = suite.target.interface
    suite.writing("unknown telecommand IDs", lambda seen: _check_unknown(suite, seen))
    for message in interface.telecommands:
        if message.supported:
            _check_telecommand(suite, message)
    for register in interface.registers or ():
        if register.writable and register.readable:
            suite.writing(
                f"register {register.name}: written", partial(_check_register, suite, register)
            )
    if interface.bench is not None:
        for letter in interface.bench.letters:
            suite.writing(f"bench letter {letter.letter!r}", partial(_check_letter, suite, letter))
        suite.writing(
            "bench: no letter of the protocol", partial(_check_no_letter, suite, interface.bench)
        )


def _check_telecommand(suite: Suite, message: Message) -> None:
    name = f"telecommand {message.name}"
    suite.writing(f"{name}: wrong lengths", partial(_check_lengths, suite, message))
    for field, data in violations(message):
        suite.writing(
            f"{name}: {field.name} out of range", partial(_check_range, suite, message, field, data)
        )
    suite.writing(name, partial(_check_effect, suite, message))


def _check_unknown(suite: Suite, seen: list[str]) -> None:
    declared = {m.id for m in suite.target.interface.telecommands if m.supported}
    unknown = [identifier for identifier in range(TELEMETRY_BIT) if identifier not in declared]
    for identifier in unknown:
        _expect_error(suite, bytes([identifier]), "INVALID_ID", f"ID {identifier}")
    seen.append(f"{len(unknown)} refused")


def _check_lengths(suite: Suite, message: Message, seen: list[str]) -> None:
    data = message.pack(**message.reset_values())
    for wrong in [data + b"\0", data[:-1]] if data else [b"\0"]:
        what = f"{len(wrong)} bytes"
        _expect_error(suite, bytes([message.id]) + wrong, "WRONG_LENGTH", what)
        seen.append(f"{what} refused")


def _check_range(
    suite: Suite, message: Message, field: Field, data: bytes, seen: list[str]
) -> None:
    """``field`` at a value that its limits forbid, the others at their reset values."""
    before = _shown(suite, message)
    what = f"{field.name} = {field.label(message.unpack(data)[field.name])}"
    _expect_error(suite, bytes([message.id]) + data, "BAD_PARAMETER", what)
    seen.append("refused")
    if _shown(suite, message) != before:
        raise FailedError(f"refused, but {what} changed what is read back")
    _expect_flag(suite, field.range_flag, seen)


def _check_effect(suite: Suite, message: Message, seen: list[str]) -> None:
    if message.name in TASKS:
        TASKS[message.name](suite, message, seen)
        return
    before = _shown(suite, message)
    if before is None:
        _perform_any(suite, message)
        seen.append("processed")
        if message.name in ENDED_BY:
            perform(suite, suite.target.interface.telecommand(ENDED_BY[message.name]), {})
        return
    refused = 0
    for tried in [*values_to_try(message), before]:
        values = tried | keys_of(message)
        try:
            perform(suite, message, values)
        except CommandRefusedError:
            if message.name not in OPTIONAL or values == before:
                raise
            refused += 1
            continue
        _expect_shown(suite, message, values)
    seen.append("read back" + (f", {refused} values not there" if refused else ""))


def _perform_any(suite: Suite, message: Message) -> None:
    """Perform it with the first values that the node takes: not all go together with its state."""
    refusal: CommandRefusedError | None = None
    for values in values_to_try(message):
        try:
            perform(suite, message, values)
            return
        except CommandRefusedError as error:
            refusal = refusal or error
    if refusal is not None:
        raise refusal


def _shown(suite: Suite, message: Message) -> dict[str, Value] | None:
    """What telemetry shows of a telecommand's fields; None when not all are there."""
    places = read_back(suite.target.interface, message)
    if not places:
        return None
    frames = {telemetry.name for telemetry, _ in places.values()}
    read = {name: suite.target.node.telemetry(name) for name in sorted(frames)}
    values = {name: read[place.name][field.name] for name, (place, field) in places.items()}
    return message.unpack(message.pack(**values, **keys_of(message)))


def _expect_shown(suite: Suite, message: Message, wanted: Mapping[str, Value]) -> None:
    found = _shown(suite, message) or {}
    for field in message.fields:
        if found[field.name] != wanted[field.name]:
            raise FailedError(
                f"{field.name} was set to {field.label(wanted[field.name])}, "
                f"{field.label(found[field.name])} is read back"
            )


def _expect_error(suite: Suite, payload: bytes, error: str, what: str) -> None:
    codes = suite.target.interface.ack_errors
    answer = suite.request(payload)
    if answer is None:
        raise FailedError(f"{what}: no acknowledge, declared {error}")
    if answer != bytes([codes[error]]):
        known = {int(code): code.name for code in codes}
        name = known.get(answer[0], "unknown") if len(answer) == 1 else "no error code"
        raise FailedError(f"{what}: acknowledged with {answer.hex()} ({name}), declared {error}")


def _expect_flag(suite: Suite, flag: str, seen: list[str]) -> None:
    if not flag:
        return
    for telemetry in suite.target.interface.telemetries:
        for field in telemetry.fields:
            if telemetry.supported and (field.flag or field.name) == flag:
                if not suite.target.node.telemetry(telemetry.name)[field.name]:
                    raise FailedError(f"refused, but flag {flag} is not set in {telemetry.name}")
                seen.append(f"flag {flag}")
                return


def _check_register(suite: Suite, register: PointerRegister, seen: list[str]) -> None:
    client = suite.target.registers
    if client is None:
        raise SkippedError("no I2C bus within reach")
    before = client.read(register.name)
    label = register.field.label
    low, high = limits_of(register.field)
    for value in (int(low), int(high), before):
        client.write(register.name, value)
        found = client.read(register.name)
        if found == before and register.name in OPTIONAL:
            continue
        if found != value:
            raise FailedError(f"{label(value)} was written, {label(found)} is read")
    seen.append("read back")
    if high < register.field.raw_range[1]:
        client.write_raw(register.address, bytes([int(high) + 1]))
        found = client.read(register.name)
        if found != before:
            raise FailedError(
                f"{int(high) + 1} is not allowed, but {label(found)} is read after it"
            )
        seen.append("wrong value ignored")


def _check_letter(suite: Suite, letter: Letter, seen: list[str]) -> None:
    line = _bench_line(suite)
    line.write(letter.request)
    answer = bytearray()
    while len(answer) < letter.length:
        data = line.read(BENCH_READ_BYTES, BENCH_TIMEOUT_S)
        if not data:
            break
        answer += data
    if len(answer) != letter.length or letter.answer not in (None, bytes(answer)):
        raise FailedError(f"{len(answer)} bytes came, declared {letter.length}")
    seen.append(f"{letter.length} bytes")


def _check_no_letter(suite: Suite, protocol: BenchProtocol, seen: list[str]) -> None:
    unknown = next(byte for byte in range(256) if protocol.find(byte) is None)
    line = _bench_line(suite)
    line.write(bytes([unknown]))
    data = line.read(BENCH_READ_BYTES, BENCH_TIMEOUT_S)
    if data:
        raise FailedError(f"{unknown:#04x} was answered with {len(data)} bytes")
    seen.append("no answer")


def _bench_line(suite: Suite) -> Transport:
    if suite.target.bench is None:
        raise SkippedError("no line with the bench protocol within reach")
    return suite.target.bench

"""Checks that change the device: telecommands, their errors and effects, registers, bench letters.

A setting that can be read back is restored.
"""

from collections.abc import Mapping
from functools import partial

from cubestack.firmware_model.interface.codec.field import Field, Value
from cubestack.firmware_model.interface.codec.letters import Letter, LetterProtocol
from cubestack.firmware_model.interface.codec.message import TELEMETRY_BIT, Message
from cubestack.firmware_model.interface.codec.register_pointer import PointerRegister
from cubestack.host.conformance.contract import (
    CheckRun,
    FailedError,
    SkippedError,
    limits_of,
    values_to_try,
    violations,
)
from cubestack.host.conformance.effects import OF_SWITCHES
from cubestack.host.devices.shown_settings import keys_of, read_back
from cubestack.host.errors import CommandRefusedError
from cubestack.host.transport.streams import READ_BYTES, Transport, read_answer

LETTER_TIMEOUT_S = 3.0


def check_writes(run: CheckRun) -> None:
    """Run all; without permission each is reported as skipped."""
    interface = run.target.interface
    run.writing("unknown telecommand IDs", lambda seen: _check_unknown(run, seen))
    for message in interface.telecommands:
        if message.supported:
            _check_telecommand(run, message)
    for register in interface.registers or ():
        if register.writable and register.readable:
            run.writing(
                f"register {register.name}: written", partial(_check_register, run, register)
            )
    if interface.service_port is not None:
        for letter in interface.service_port.letters:
            run.writing(f"bench letter {letter.letter!r}", partial(_check_letter, run, letter))
        run.writing(
            "bench: no letter of the protocol",
            partial(_check_no_letter, run, interface.service_port),
        )


def _check_telecommand(run: CheckRun, message: Message) -> None:
    name = f"telecommand {message.name}"
    run.writing(f"{name}: wrong lengths", partial(_check_lengths, run, message))
    for field, data in violations(message):
        run.writing(
            f"{name}: {field.name} out of range", partial(_check_range, run, message, field, data)
        )
    run.writing(name, partial(_check_effect, run, message))


def _check_unknown(run: CheckRun, seen: list[str]) -> None:
    declared = {m.id for m in run.target.interface.telecommands if m.supported}
    unknown = [identifier for identifier in range(TELEMETRY_BIT) if identifier not in declared]
    for identifier in unknown:
        run.expect_error(bytes([identifier]), "INVALID_ID", f"ID {identifier}")
    seen.append(f"{len(unknown)} refused")


def _check_lengths(run: CheckRun, message: Message, seen: list[str]) -> None:
    data = message.pack(**message.reset_values())
    for wrong in [data + b"\0", data[:-1]] if data else [b"\0"]:
        what = f"{len(wrong)} bytes"
        run.expect_error(bytes([message.id]) + wrong, "WRONG_LENGTH", what)
        seen.append(f"{what} refused")


def _check_range(
    run: CheckRun, message: Message, field: Field, data: bytes, seen: list[str]
) -> None:
    """``field`` at a forbidden value, the others at their reset values."""
    before = _shown(run, message)
    what = f"{field.name} = {field.label(message.unpack(data)[field.name])}"
    run.expect_error(bytes([message.id]) + data, "BAD_PARAMETER", what)
    seen.append("refused")
    if _shown(run, message) != before:
        raise FailedError(f"refused, but {what} changed what is read back")
    _expect_flag(run, field.range_flag, seen)


def _check_effect(run: CheckRun, message: Message, seen: list[str]) -> None:
    notes = run.notes
    effects = {**OF_SWITCHES, **notes.effects}
    if message.name in effects:
        effects[message.name](run, message, seen)
        return
    before = _shown(run, message)
    if before is None:
        _perform_any(run, message)
        seen.append("processed")
        if message.name in notes.ended_by:
            run.perform(notes.ended_by[message.name], {})
        return
    refused = 0
    for tried in [*values_to_try(message), before]:
        values = tried | keys_of(message, notes)
        try:
            run.perform(message.name, values)
        except CommandRefusedError:
            if message.name not in notes.optional or values == before:
                raise
            refused += 1
            continue
        _expect_shown(run, message, values)
    seen.append("read back" + (f", {refused} values not there" if refused else ""))


def _perform_any(run: CheckRun, message: Message) -> None:
    """Perform it with the first values that the node accepts in its state."""
    refusal: CommandRefusedError | None = None
    for values in values_to_try(message):
        try:
            run.perform(message.name, values)
            return
        except CommandRefusedError as error:
            refusal = refusal or error
    if refusal is not None:
        raise refusal


def _shown(run: CheckRun, message: Message) -> dict[str, Value] | None:
    """A telecommand's fields in telemetry; None unless all are there."""
    places = read_back(run.target.interface, message, run.notes)
    if not places:
        return None
    frames = {telemetry.name for telemetry, _ in places.values()}
    read = {name: run.target.node.telemetry(name) for name in sorted(frames)}
    values = {name: read[place.name][field.name] for name, (place, field) in places.items()}
    return message.unpack(message.pack(**values, **keys_of(message, run.notes)))


def _expect_shown(run: CheckRun, message: Message, wanted: Mapping[str, Value]) -> None:
    found = _shown(run, message) or {}
    for field in message.fields:
        if found[field.name] != wanted[field.name]:
            raise FailedError(
                f"{field.name} was set to {field.label(wanted[field.name])}, "
                f"{field.label(found[field.name])} is read back"
            )


def _expect_flag(run: CheckRun, flag: str, seen: list[str]) -> None:
    if not flag:
        return
    for telemetry in run.target.interface.telemetries:
        for field in telemetry.fields:
            if telemetry.supported and (field.flag or field.name) == flag:
                if not run.target.node.telemetry(telemetry.name)[field.name]:
                    raise FailedError(f"refused, but flag {flag} is not set in {telemetry.name}")
                seen.append(f"flag {flag}")
                return


def _check_register(run: CheckRun, register: PointerRegister, seen: list[str]) -> None:
    client = run.registers
    before = client.read(register.name)
    label = register.field.label
    low, high = limits_of(register.field)
    for value in (int(low), int(high), before):
        client.write(register.name, value)
        found = client.read(register.name)
        if found == before and register.name in run.notes.optional:
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


def _check_letter(run: CheckRun, letter: Letter, seen: list[str]) -> None:
    line = _service_port(run)
    line.write(letter.request)
    answer = read_answer(line, letter.length, LETTER_TIMEOUT_S)
    if len(answer) != letter.length or letter.answer not in (None, answer):
        raise FailedError(f"{len(answer)} bytes came, declared {letter.length}")
    seen.append(f"{letter.length} bytes")


def _check_no_letter(run: CheckRun, protocol: LetterProtocol, seen: list[str]) -> None:
    unknown = next(byte for byte in range(256) if protocol.find(byte) is None)
    line = _service_port(run)
    line.write(bytes([unknown]))
    data = line.read(READ_BYTES, LETTER_TIMEOUT_S)
    if data:
        raise FailedError(f"{unknown:#04x} was answered with {len(data)} bytes")
    seen.append("no answer")


def _service_port(run: CheckRun) -> Transport:
    if run.target.service_port is None:
        raise SkippedError("no line with the bench protocol")
    return run.target.service_port

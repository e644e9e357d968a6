from dataclasses import replace
from typing import Any

import pytest

from cubestack.firmware_model.interface.codec.register_pointer import FILL
from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubesense.registers import REGISTERS
from cubestack.host.clients.node import NodeClient
from cubestack.host.clients.registers import RegisterClient, RegisterLine
from cubestack.host.conformance.contract import CheckResult, CheckRun, Verdict
from cubestack.host.conformance.suite import check_reads
from cubestack.host.conformance.writes import check_writes
from cubestack.host.devices.device import ConformanceNotes
from cubestack.host.targets import Target
from tests.host.conftest import FakeNode, LetterLine, Line, Slave, UartLink

#: Of CubeSense without most of its messages, which other tests walk.
BARE = replace(INTERFACE, telecommands=(), telemetries=INTERFACE.telemetries[:1])
SETTINGS = [one for one in REGISTERS if one.writable and one.readable]
LETTERS = INTERFACE.service_port.letters


class Registers(Slave):
    """Registers with valid values, which ignore others.

    Attributes:
        kept: names of registers that no write changes.
        takes_all: whether invalid values are stored.
    """

    def __init__(self) -> None:
        super().__init__()
        self.kept: set[str] = set()
        self.takes_all = False
        for one in REGISTERS:
            if one.readable and not one.streams:
                least = int(one.field.reset or max(one.field.low, 0))
                self.content[one.address] = least.to_bytes(one.length, "big")

    def i2c_rdwr(self, *messages: Any) -> None:
        before = dict(self.content)
        super().i2c_rdwr(*messages)
        for one in SETTINGS:
            value = one.decode(self.content[one.address])
            if one.name in self.kept or not (self.takes_all or one.allows(value)):
                self.content[one.address] = before[one.address]


@pytest.fixture
def slave() -> Registers:
    return Registers()


@pytest.fixture
def bench() -> LetterLine:
    return LetterLine(**{one.letter: one.answer or bytes(one.length) for one in LETTERS})


def checked(slave: Slave | None, bench: LetterLine | None, **notes: Any) -> dict[str, CheckResult]:
    client = NodeClient(UartLink(FakeNode(BARE)), BARE, retries=0)
    registers = None if slave is None else RegisterClient(slave, REGISTERS)
    target = Target("fake", BARE, client, registers=registers, service_port=bench)
    run = CheckRun(target, allow_write=True, notes=ConformanceNotes(**notes))
    check_writes(run)
    return {check.name: check for check in run.checks}


def failed(checks: dict[str, CheckResult]) -> dict[str, str]:
    return {name: one.detail for name, one in checks.items() if one.verdict is Verdict.FAILED}


def test_correct_device_passes_and_keeps_its_settings(slave: Registers, bench: LetterLine) -> None:
    before = dict(slave.content)
    checks = checked(slave, bench)
    assert {one.verdict for one in checks.values()} == {Verdict.PASSED}
    assert set(checks) == {
        "unknown telecommand IDs",
        *(f"register {one.name}: written" for one in SETTINGS),
        *(f"bench letter {one.letter!r}" for one in LETTERS),
        "bench: no letter of the protocol",
    }
    assert slave.content == before
    assert checks["unknown telecommand IDs"].detail == "128 refused"
    assert checks["bench: no letter of the protocol"].detail == "no answer"
    for one in LETTERS:
        assert checks[f"bench letter {one.letter!r}"].detail == f"{one.length} bytes"


def test_conformance_writes_each_register_at_its_limits_and_beyond(
    slave: Registers, bench: Any
) -> None:
    checks = checked(slave, bench)
    for one in SETTINGS:
        written = [data[1] for data in slave.written if data[0] == one.address]
        allowed = [value for value in range(256) if one.allows(one.decode(bytes([value])))]
        assert {min(allowed), max(allowed)} <= set(written)
        beyond = max(allowed) + 1
        assert (beyond in written) == (beyond < 256)
        detail = "read back, wrong value ignored" if beyond < 256 else "read back"
        assert checks[f"register {one.name}: written"].detail == detail


@pytest.mark.parametrize("name", [one.name for one in SETTINGS])
def test_setting_that_does_not_change_is_found(name: str, slave: Registers, bench: Any) -> None:
    slave.kept = {name}
    found = failed(checked(slave, bench))
    assert set(found) == {f"register {name}: written"}
    assert " was written, " in found[f"register {name}: written"]
    assert failed(checked(slave, bench, optional=frozenset({name}))) == {}


def test_stored_invalid_value_is_found(slave: Registers, bench: LetterLine) -> None:
    slave.takes_all = True
    narrow = [one for one in SETTINGS if not one.allows(one.decode(b"\xff"))]
    found = failed(checked(slave, bench))
    assert set(found) == {f"register {one.name}: written" for one in narrow}
    assert all("is not allowed, but" in detail for detail in found.values())


def test_conformance_skips_checks_without_a_bus_or_bench_line() -> None:
    checks = checked(None, None)
    skipped = {name: one.detail for name, one in checks.items() if one.verdict is Verdict.SKIPPED}
    assert set(checks) - set(skipped) == {"unknown telecommand IDs"}
    for name, detail in skipped.items():
        expected = "no I2C bus" if name.startswith("register") else "no line with the bench"
        assert detail.startswith(expected)


def test_wrong_bench_answers_are_found(slave: Registers, bench: LetterLine) -> None:
    short = next(one for one in LETTERS if one.answer is None and one.length > 1)
    wrong = next(one for one in LETTERS if one.answer is not None)
    bench.answers |= {short.letter: bytes(short.length - 1), wrong.letter: bytes(wrong.length)}
    found = failed(checked(slave, bench))
    assert f"declared {short.length}" in found[f"bench letter {short.letter!r}"]
    assert f"bench letter {wrong.letter!r}" in found


def test_answer_to_an_unknown_letter_is_found(slave: Registers, bench: LetterLine) -> None:
    class Chatty(LetterLine):
        def write(self, data: bytes) -> None:
            super().write(data)
            if data.decode("latin-1") not in self.answers:
                self.pending += b"abc"

    found = failed(checked(slave, Chatty(**bench.answers)))
    assert found["bench: no letter of the protocol"].endswith("was answered with 3 bytes")


def reads(slave: Any, *, line: bool = False) -> dict[str, CheckResult]:
    node = NodeClient(UartLink(FakeNode(INTERFACE)), INTERFACE, retries=0)
    bus = RegisterLine(slave, timeout_s=0.0) if line else slave
    registers = RegisterClient(bus, REGISTERS, retries=0, wait=lambda _s: None)
    run = CheckRun(Target("fake", INTERFACE, node, registers=registers))
    check_reads(run)
    return {one.name: one for one in run.checks if one.name.startswith("register")}


def test_every_readable_register_is_checked() -> None:
    found = reads(Registers())
    names = {f"register {one.name}" for one in REGISTERS if one.readable and not one.streams}
    assert names < set(found)
    (unused,) = set(found) - names
    assert "without a register" in unused
    assert {one.verdict for one in found.values()} == {Verdict.PASSED}
    assert found[unused].detail == bytes([FILL, FILL]).hex()


NARROW = [
    one.name
    for one in REGISTERS
    if one.readable and one.writable and not one.field.allows(one.decode(b"\xff"), {})
]


@pytest.mark.parametrize("name", NARROW)
def test_invalid_register_value_is_found(name: str) -> None:
    slave, register = Registers(), REGISTERS[name]
    slave.content[register.address] = b"\xff"
    found = reads(slave)
    wrong = {one.name: one.detail for one in found.values() if one.verdict is Verdict.FAILED}
    assert set(wrong) == {f"register {name}"}
    assert wrong[f"register {name}"].endswith(" is not allowed")


def test_value_at_an_unused_address_is_found() -> None:
    slave = Registers()
    unused = max(address for address in range(256) if REGISTERS.at(address) is None)
    slave.content[unused] = b"\x12\x34"
    found = reads(slave)[f"register address {unused:#04x} without a register"]
    assert (found.verdict, found.detail) == (
        Verdict.FAILED,
        f"read 1234, declared {FILL:#04x} in each byte",
    )


class Uart(Line):
    """Registers on a serial line; with ``talks``, unused addresses are answered too."""

    talks = False

    def __init__(self) -> None:
        super().__init__()
        self.slave = Registers()

    def write(self, data: bytes) -> None:
        _, address = data
        self.pending += self.slave.content.get(address, b"\x12\x34" if self.talks else b"")


@pytest.mark.parametrize("talks", [False, True])
def test_register_line_must_not_answer_unused_addresses(talks: bool) -> None:
    line = Uart()
    line.talks = talks
    (found,) = (one for name, one in reads(line, line=True).items() if "without" in name)
    verdict = Verdict.FAILED if talks else Verdict.PASSED
    detail = "read 1234, declared no answer" if talks else "no answer"
    assert (found.verdict, found.detail) == (verdict, detail)

from dataclasses import replace
from functools import partial
from typing import Any

import pytest

from cubestack.firmware_model.interface.codec.register_pointer import FILL
from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.firmware_model.interface.cubesense.registers import REGISTERS
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR
from cubestack.firmware_model.interface.cubestar import ResetCause
from cubestack.host.clients.node import NodeClient
from cubestack.host.clients.registers import RegisterClient, RegisterLine
from cubestack.host.conformance import contract
from cubestack.host.conformance.contract import CheckResult, CheckRun, FailedError, Verdict
from cubestack.host.conformance.effects import check_watchdog
from cubestack.host.conformance.suite import check_reads, run_suite
from cubestack.host.devices.device import ConformanceNotes
from cubestack.host.devices.registry import device
from cubestack.host.devices.shown_settings import read_back
from cubestack.host.errors import NoAnswerError
from cubestack.host.targets import Target
from tests.host.conformance.test_suite import SMALL, good, spoil, suite
from tests.host.conformance.test_suite import failures as all_failures
from tests.host.conftest import FakeNode, Line, Slave, UartLink

__all__ = ["good"]


def failures(run: CheckRun) -> dict[str, str]:
    """What failed, except response times, which depend on the load of the machine."""
    found = all_failures(run)
    found.pop("times of answers", None)
    return found


def damage_block(node: Any, values: dict[str, Any]) -> None:
    node.memory[128 * values["BlockNumber"] + 7] ^= 1


def change_reset_cause(node: Any, _values: dict[str, Any]) -> None:
    other = next(cause for cause in ResetCause if cause is not ResetCause.WATCHDOG)
    node.values["ExtendedIdentification"]["ResetCause"] = other


def change_switch(node: Any, _values: dict[str, Any]) -> None:
    shown = node.values["Profile"]
    name = next(iter(shown))
    shown[name] = 1 - min(1, int(shown[name]))


@pytest.mark.parametrize(
    ("name", "effect", "detail"),
    [
        ("UploadBlock", damage_block, "block 3 is not what was uploaded"),
        ("TestWDG", change_reset_cause, "declared WATCHDOG"),
        ("SetSwitch", change_switch, "was set, Profile is {"),
    ],
)
def test_wrong_effect_of_a_telecommand_is_found(
    good: Any, uart: Any, monkeypatch: pytest.MonkeyPatch, name: str, effect: Any, detail: str
) -> None:
    spoil(monkeypatch, good, name, partial(effect, good))
    found = failures(suite(good, uart, allow_write=True))
    assert detail in found.pop(f"telecommand {name}")
    assert found == {} or name == "SetSwitch"


@pytest.mark.parametrize(("before", "cleared"), [(0, True), (3, False)])
def test_earlier_watchdog_resets_are_not_cleared(
    good: Any, uart: Any, before: int, cleared: bool
) -> None:
    good.values["ExtendedIdentification"]["WDGResetCount"] = before
    run, seen = suite(good, uart, allow_write=True), list[str]()
    check_watchdog(run, CUBESTAR.telecommand("TestWDG"), seen)
    assert seen == ["reset and counted"]
    names = [name for name, _ in good.log]
    assert names == ["TestWDG", *(["ClearWDGResetCounter"] if cleared else [])]


def test_refusal_that_changes_a_setting_is_found(
    good: Any, uart: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer, message = good.answer, CUBESTAR.telecommand("setIDMode")
    ((telemetry, field),) = read_back(CUBESTAR, message, SMALL).values()

    def careless(payload: bytes) -> bytes | None:
        reply: bytes | None = answer(payload)
        if reply == b"\x03" and payload[0] == message.id:
            shown = good.values[telemetry.name]
            shown[field.name] = 1 - shown[field.name]
        return reply

    monkeypatch.setattr(good, "answer", careless)
    found = failures(suite(good, uart, allow_write=True))
    (name,) = found
    assert name.startswith("telecommand setIDMode: ")
    assert found[name].startswith("refused, but ")
    assert found[name].endswith(" changed what is read back")


@pytest.mark.parametrize("optional", [False, True])
def test_values_of_optional_hardware_may_be_refused(
    good: Any, uart: Any, monkeypatch: pytest.MonkeyPatch, optional: bool
) -> None:
    answer, message = good.answer, CUBESTAR.telecommand("Exposure")
    usual = message.pack(**message.reset_values())
    refused = list[bytes]()

    def poor(payload: bytes) -> bytes | None:
        whole = len(payload) == 1 + message.length and payload[0] == message.id
        if whole and payload[1:] != usual and not message.violations(message.unpack(payload[1:])):
            refused.append(payload)
            return b"\x03"
        reply: bytes | None = answer(payload)
        return reply

    monkeypatch.setattr(good, "answer", poor)
    run = suite(good, uart, allow_write=True)
    if optional:
        run.notes = replace(run.notes, optional=frozenset({"Exposure"}))
    found = failures(run)
    if not optional:
        assert set(found) == {"telecommand Exposure"}
        assert "refused: BAD_PARAMETER" in found["telecommand Exposure"]
        return
    assert found == {}
    (one,) = (check for check in run.checks if check.name == "telecommand Exposure")
    assert one.detail == f"read back, {len(refused)} values not there"
    assert refused


def test_node_that_does_not_restart_times_out(
    good: Any, uart: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = suite(good, uart, allow_write=True)
    waits, polls = list[float](), list[str]()

    class Gone:
        """Does not answer for ``silence`` polls after a telecommand."""

        silence = 10**6

        def command(self, name: str, **_values: object) -> None:
            polls.clear()

        def wait_processed(self, timeout_s: float) -> None:
            raise NoAnswerError(f"no answer for {timeout_s:g} s")

        def telemetry(self, name: str) -> dict[str, int]:
            polls.append(name)
            if len(polls) <= self.silence:
                raise NoAnswerError("no answer")
            return {}

        def pause(self, seconds: float) -> None:
            waits.append(seconds)

    gone: Any = Gone()
    run.target.node = gone
    with pytest.raises(FailedError, match=r"no answer for 10 s after Reset"):
        run.perform("Reset", {})
    assert sum(waits) == pytest.approx(contract.RESTART_TIMEOUT_S)
    assert set(polls) == {CUBESTAR.telemetries[0].name}
    gone.silence = 3
    waits.clear()
    run.perform("Reset", {})
    assert len(waits) == 3


@pytest.mark.parametrize("known", [True, False])
def test_notes_of_a_known_device_are_used(good: Any, uart: Any, known: bool) -> None:
    client = NodeClient(uart, CUBESTAR, retries=0)
    own = device("cubestar") if known else None
    told = list[CheckResult]()
    run = run_suite(Target("fake", CUBESTAR, client, uart, device=own), on_check=told.append)
    assert run.notes == (device("cubestar").conformance if known else ConformanceNotes())
    assert run.checks == told
    assert len(told) > len(CUBESTAR.telecommands)
    assert not run.allow_write


# --- registers ------------------------------------------------------------------------------------


class Filled(Slave):
    """Registers with valid values; other addresses return the fill byte."""

    def __init__(self) -> None:
        super().__init__()
        for one in REGISTERS:
            if one.readable and not one.streams:
                least = int(max(one.field.low, 0))
                self.content[one.address] = least.to_bytes(one.length, "big")


def reads(slave: Any, *, line: bool = False) -> dict[str, CheckResult]:
    node = NodeClient(UartLink(FakeNode(CUBESENSE)), CUBESENSE, retries=0)
    bus = RegisterLine(slave, timeout_s=0.0) if line else slave
    registers = RegisterClient(bus, REGISTERS, retries=0, wait=lambda _s: None)
    run = CheckRun(Target("fake", CUBESENSE, node, registers=registers))
    check_reads(run)
    return {one.name: one for one in run.checks if one.name.startswith("register")}


def test_every_readable_register_is_checked() -> None:
    found = reads(Filled())
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
    slave, register = Filled(), REGISTERS[name]
    slave.content[register.address] = b"\xff"
    found = reads(slave)
    wrong = {one.name: one.detail for one in found.values() if one.verdict is Verdict.FAILED}
    assert set(wrong) == {f"register {name}"}
    assert wrong[f"register {name}"].endswith(" is not allowed")


def test_value_at_an_unused_address_is_found() -> None:
    slave = Filled()
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
        self.slave = Filled()

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

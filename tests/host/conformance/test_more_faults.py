from dataclasses import replace
from typing import Any

import pytest

from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR
from cubestack.host.clients.node import NodeClient
from cubestack.host.conformance import contract
from cubestack.host.conformance.contract import CheckResult, FailedError
from cubestack.host.conformance.effects import check_watchdog
from cubestack.host.conformance.suite import run_suite
from cubestack.host.devices.device import ConformanceNotes
from cubestack.host.devices.registry import device
from cubestack.host.devices.shown_settings import read_back
from cubestack.host.errors import NoAnswerError
from cubestack.host.targets import Target
from tests.host.conformance.test_suite import SMALL, failures, good, suite

__all__ = ["good"]


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


def test_refusal_that_changes_a_setting_is_found(good: Any, uart: Any, monkeypatch: Any) -> None:
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
    good: Any, uart: Any, monkeypatch: Any, optional: bool
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


def test_node_that_does_not_restart_times_out(good: Any, uart: Any, monkeypatch: Any) -> None:
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

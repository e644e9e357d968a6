from dataclasses import replace
from functools import partial

import pytest

from cubestack.firmware_model.interface.aramis import INTERFACE as ARAMIS
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.firmware_model.interface.codec.switch_messages import (
    apply_command,
    read_switches,
    shown_values,
)
from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR
from cubestack.firmware_model.interface.cubestar import ResetCause
from cubestack.firmware_model.interface.cubestar.switches import CubeStarSwitches
from cubestack.host.clients.node import NodeClient
from cubestack.host.conformance.comparison import Difference, Kind, compare, table
from cubestack.host.conformance.contract import CheckResult, CheckRun, Verdict, values_to_try
from cubestack.host.conformance.effects import check_stream
from cubestack.host.conformance.suite import check_reads
from cubestack.host.conformance.writes import check_writes
from cubestack.host.devices.registry import device, devices
from cubestack.host.devices.shown_settings import read_back
from cubestack.host.targets import Target

BLOCKS = 4
NOTES = {name: device(name).conformance for name in ("cubestar", "cubesense")}
STREAM = {"StreamDownImage": partial(check_stream, picture_bytes=128 * BLOCKS)}
SMALL = replace(NOTES["cubestar"], effects=NOTES["cubestar"].effects | STREAM)


def suite(node, link, **options) -> CheckRun:
    interface = node.interface
    client = NodeClient(link, interface, retries=0)
    return CheckRun(Target("fake", interface, client, link), notes=SMALL, **options)


@pytest.fixture
def good(node, uart, monkeypatch):
    """A CubeStar in memory that shows its settings, and the error flags of refusals."""
    places = {m.name: read_back(CUBESTAR, m, SMALL) for m in CUBESTAR.telecommands}
    for message in CUBESTAR.telemetries:  # after power-up, settings show their reset values
        node.values[message.name] = {}
    for name, shown in places.items():
        reset = CUBESTAR.telecommand(name).reset_values()
        for field, (telemetry, place) in shown.items():
            node.values[telemetry.name][place.name] = reset[field]
    node.values["Identification"]["InterfaceVersion"] = CUBESTAR.version
    node.values["ExtendedIdentification"]["ResetCause"] = 1
    node.values["Profile"] = shown_values(CubeStarSwitches.of("extended"))
    node.values["TaskStatus"]["taskStatus"] = node.values["LogStatus"]["Status"] = 1
    execute, answer = node.execute, node.answer

    def remember(name, values):
        execute(name, values)
        perform(name, values)
        for field, (telemetry, place) in places[name].items():
            node.values[telemetry.name][place.name] = values[field]

    camera = {}

    def perform(name, values):
        identification, shown = node.values["ExtendedIdentification"], node.values["CameraRegister"]
        if name == "StreamDownImage":
            blocks = node.memory.reshape(-1, 128)[:BLOCKS]
            uart.later += b"".join(encode_frame(block.tobytes()) for block in blocks)
        elif name == "UploadBlock":
            node.values["UploadStatus"]["NextBlock"] = values["BlockNumber"] + 1
        elif name in ("SetProfile", "SetSwitch"):
            switches = read_switches(CubeStarSwitches, node.values["Profile"])
            node.values["Profile"] = shown_values(apply_command(switches, name, values))
        elif name == "TestWDG":
            identification["WDGResetCount"] = identification.get("WDGResetCount", 0) + 1
            identification["ResetCause"] = ResetCause.WATCHDOG
        elif name == "ClearWDGResetCounter":
            identification["WDGResetCount"] = 0
        elif name == "SelectCameraRegister":
            shown["Address"], shown["Valid"] = values["Address"], 1
        elif name == "WriteCameraRegister":
            camera[values["Address"]] = values["Value"]
        shown["Value"] = camera.get(shown.get("Address"), 0)

    def flag(payload):
        reply = answer(payload)
        if reply == b"\x03" and payload[0] < 128:
            message = CUBESTAR.find(payload[0])
            for _, name in message.violations(message.unpack(payload[1:])):
                if name:
                    node.values["ErrorFlags"][name] = 1
        return reply

    monkeypatch.setattr(node, "execute", remember)
    monkeypatch.setattr(node, "answer", flag)
    return node


def failures(run: CheckRun, without: str = "times of answers") -> dict[str, str]:
    """What failed, except response times, which depend on the load of the machine."""
    check_reads(run)
    check_writes(run)
    failed = {c.name: c.detail for c in run.checks if c.verdict is Verdict.FAILED}
    return {name: detail for name, detail in failed.items() if name != without}


def test_good_node_passes(good, uart):
    run = suite(good, uart, allow_write=True)
    assert failures(run) == {}
    assert {check.verdict for check in run.checks} == {Verdict.PASSED}
    names = [check.name for check in run.checks]
    assert len(set(names)) == len(names)
    for message in CUBESTAR.messages:
        if message.supported:
            assert f"{message.kind.value} {message.name}" in names


def test_nothing_is_sent_without_permission(good, uart):
    run = suite(good, uart)
    assert failures(run) == {}
    assert good.log == []
    skipped = [check for check in run.checks if check.verdict is Verdict.SKIPPED]
    assert "telecommand Exposure" in {check.name for check in skipped}
    assert all("--allow-write" in check.detail for check in skipped)


def test_conformance_suite_restores_settings(good, uart):
    before = {name: dict(values) for name, values in good.values.items()}
    failures(suite(good, uart, allow_write=True))
    after = {name: dict(values) for name, values in good.values.items()}
    for changing in ("ErrorFlags", "UploadStatus", "ExtendedIdentification", "CameraRegister"):
        after[changing] = before[changing]
    assert {k: v for k, v in after.items() if v} == {k: v for k, v in before.items() if v}


@pytest.mark.parametrize(
    ("payload", "reply", "check", "detail"),
    [
        (b"\x80", bytes(7), "telemetry Identification", "has 7 bytes, not 8"),
        (b"\x80", None, "telemetry Identification", "no answer"),
        (b"\x80", bytes(8), "telemetry Identification", "InterfaceVersion is 0, declared 3"),
        (b"\x9b", b"\x09", "telemetry IDMode", "field Mode is 9: not allowed"),
        (b"\x07\0", b"\0", "telecommand Exposure: wrong lengths", "(OK), declared WRONG_LENGTH"),
        (b"\x07\0", None, "telecommand Exposure: wrong lengths", "no acknowledge"),
        (b"\x00", b"\0", "unknown telecommand IDs", "ID 0: acknowledged with 00"),
        (b"\x10", b"\x03", "telecommand CaptureImage", "refused: BAD_PARAMETER"),
    ],
)
def test_conformance_suite_finds_each_device_fault(
    good, uart, monkeypatch, payload, reply, check, detail
):
    answer = good.answer
    monkeypatch.setattr(good, "answer", lambda p: reply if p == payload else answer(p))
    assert detail in failures(suite(good, uart, allow_write=True))[check]


def spoil(monkeypatch, node, telecommand, effect=None):
    """Let a telecommand have no effect, or call ``effect`` with its values afterwards."""
    execute = node.execute

    def do(name, values):
        if name != telecommand or effect is not None:
            execute(name, values)
        if name == telecommand and effect is not None:
            effect(values)

    monkeypatch.setattr(node, "execute", do)


def damage_block(node, values):
    node.memory[128 * values["BlockNumber"] + 7] ^= 1


def change_reset_cause(node, _values):
    other = next(cause for cause in ResetCause if cause is not ResetCause.WATCHDOG)
    node.values["ExtendedIdentification"]["ResetCause"] = other


def change_switch(node, _values):
    shown = node.values["Profile"]
    name = next(iter(shown))
    shown[name] = 1 - min(1, int(shown[name]))


@pytest.mark.parametrize(
    ("telecommand", "effect", "check", "detail"),
    [
        ("Exposure", None, "Exposure", "is read back"),
        ("StreamDownImage", None, "StreamDownImage", "ended after 0 of 4 frames"),
        ("UploadBlock", None, "UploadBlock", "after one block {'NextBlock': 4, "),
        ("UploadBlock", damage_block, "UploadBlock", "block 3 is not what was uploaded"),
        ("TestWDG", None, "TestWDG", "WDGResetCount was 0, is 0"),
        ("TestWDG", change_reset_cause, "TestWDG", "declared WATCHDOG"),
        ("SetSwitch", change_switch, "SetSwitch", "was set, Profile is {"),
        ("WriteCameraRegister", None, "WriteCameraRegister", "0x1 was written to 0x8527"),
        ("SelectCameraRegister", None, "WriteCameraRegister", "of the camera is not read"),
    ],
)
def test_telecommand_without_effect_is_found(
    good, uart, monkeypatch, telecommand, effect, check, detail
):
    spoil(monkeypatch, good, telecommand, effect and partial(effect, good))
    found = failures(suite(good, uart, allow_write=True))
    assert detail in found[f"telecommand {check}"]
    if telecommand != "SetSwitch":
        assert set(found) <= {f"telecommand {check}", f"telecommand {telecommand}"}


def refuse(monkeypatch, node, refuses):
    """Let the node refuse changes of the switches for which ``refuses`` is true."""
    answer = node.answer

    def fixed(payload):
        message = CUBESTAR.find(payload[0]) if payload else None
        if message is not None and message.name in ("SetProfile", "SetSwitch"):
            values = message.unpack(payload[1:]) if len(payload) == 1 + message.length else {}
            if values and not message.violations(values):
                now = read_switches(CubeStarSwitches, node.values["Profile"])
                if refuses(now, apply_command(now, message.name, values), message.name):
                    return b"\x03"
        return answer(payload)

    monkeypatch.setattr(node, "answer", fixed)


def test_firmware_with_one_profile_may_refuse_the_others(good, uart, monkeypatch):
    refuse(monkeypatch, good, lambda now, wanted, _name: wanted != now)
    run = suite(good, uart, allow_write=True)
    assert failures(run) == {}
    details = {check.name: check.detail for check in run.checks}
    assert "the present one alone" in details["telecommand SetSwitch"]


@pytest.mark.parametrize(
    "refuses",
    [
        lambda now, wanted, _name: wanted == now,
        lambda now, wanted, _name: wanted != now and wanted.tracking == now.tracking,
    ],
)
def test_suite_finds_firmware_that_refuses_some_switches(good, uart, monkeypatch, refuses):
    refuse(monkeypatch, good, refuses)
    assert "telecommand SetSwitch" in failures(suite(good, uart, allow_write=True))


@pytest.mark.parametrize(
    ("change", "detail"),
    [
        (lambda sent: bytes([*sent[:10], sent[10] ^ 1, *sent[11:]]), "of the stream differs"),
        (lambda sent: encode_frame(bytes(127)) + sent, "block 0 has 127 bytes, declared 128"),
    ],
)
def test_suite_finds_a_wrong_image_stream(good, uart, monkeypatch, change, detail):
    def change_stream(_values) -> None:
        uart.later[:] = change(uart.later)

    spoil(monkeypatch, good, "StreamDownImage", change_stream)
    assert detail in failures(suite(good, uart, allow_write=True))["telecommand StreamDownImage"]


def test_missing_flag_is_found(good, uart, monkeypatch):
    telemetry = good.telemetry
    monkeypatch.setattr(
        good, "telemetry", lambda name: {} if name == "ErrorFlags" else telemetry(name)
    )
    found = failures(suite(good, uart, allow_write=True))
    assert found
    assert all("is not set in ErrorFlags" in detail for detail in found.values())


def test_answer_to_an_unknown_telemetry_is_found(good, uart, monkeypatch):
    answer = good.answer
    unknown = next(i for i in range(128, 256) if CUBESTAR.find(i) is None)
    monkeypatch.setattr(good, "answer", lambda p: b"\1" if p == bytes([unknown]) else answer(p))
    assert failures(suite(good, uart)) == {f"unknown telemetry ID {unknown}": "answered with 01"}


def test_suite_finds_a_decoder_that_ignores_frames_after_noise(good, uart, monkeypatch):
    write = uart.write
    monkeypatch.setattr(uart, "write", lambda data: write(data) if data[:1] == b"\x1f" else None)
    assert set(failures(suite(good, uart))) == {"framing: noise before a frame"}


def delay(monkeypatch, node, run, when):
    """Let an answer take 0.1 s for which ``when(request)`` is true."""
    now_s, answer = [0.0], node.answer

    def slow(payload):
        now_s[0] += 0.1 if when(payload) else 0
        return answer(payload)

    monkeypatch.setattr(run, "now_s", lambda: now_s[0])
    monkeypatch.setattr(node, "answer", slow)


@pytest.mark.parametrize(("late", "failed"), [(1, False), (3, True)])
def test_suite_reports_repeated_late_answers_only(good, uart, monkeypatch, late, failed):
    run, left = suite(good, uart), [True] * late
    delay(monkeypatch, good, run, lambda payload: payload == b"\x87" and left and left.pop())
    assert ("times of answers" in failures(run, without="")) is failed


@pytest.mark.parametrize("interface", [CUBESTAR, CUBESENSE, ARAMIS], ids=lambda i: i.name)
def test_values_to_try_are_valid_and_distinct(interface):
    for message in interface.telecommands:
        tried = list(values_to_try(message))
        assert tried
        assert all(not message.violations(values) for values in tried)
        assert all(tried.count(values) == 1 for values in tried)


def test_conformance_reads_masks_back_but_not_measurements():
    names = ("XMin", "XMax", "YMin", "YMax")
    for number in (1, 2):
        places = read_back(CUBESENSE, CUBESENSE.telecommand(f"Mask{number}"), NOTES["cubesense"])
        shown = {name: (frame.name, place.name) for name, (frame, place) in places.items()}
        assert shown == {name: (f"Masks{number}", f"{name}1") for name in names}
    assert read_back(CUBESTAR, CUBESTAR.telecommand("setTrackingMode"), SMALL) == {}


def runs(*checks: CheckResult) -> CheckRun:
    return CheckRun(Target("x", CUBESTAR, None), checks=list(checks))


def test_comparison_shows_all_differences_by_kind():
    def checks(*results: tuple[str, Verdict, str]) -> CheckRun:
        return runs(*(CheckResult(name, how, "why", (seen,)) for name, how, seen in results))

    passed, failed, skipped = Verdict.PASSED, Verdict.FAILED, Verdict.SKIPPED
    first = checks(
        ("a", passed, "Gain=1"), ("b", passed, "x"), ("c", skipped, ""), ("d", passed, "")
    )
    other = checks(
        ("a", passed, "Gain=2"), ("b", failed, "x"), ("c", passed, "y"), ("e", passed, "")
    )
    assert compare(first, first) == []
    found = compare(first, other)
    assert found == [
        Difference(Kind.OUTCOME, "b", "passed", "failed: why"),
        Difference(Kind.VALUE, "a", "Gain=1", "Gain=2"),
        Difference(Kind.MISSING, "d", "passed", ""),
        Difference(Kind.MISSING, "e", "", "passed"),
    ]
    assert table(found, "x", "y") == [
        "4 differences between x (<) and y (>)",
        "another outcome: 1",
        "  b",
        "    < passed",
        "    > failed: why",
        "another value: 1",
        "  a",
        "    < Gain=1",
        "    > Gain=2",
        "not checked on both: 2",
        "  d",
        "    < passed",
        "  e",
        "    > passed",
    ]
    assert table([], "x", "y") == ["x and y do not differ"]


def test_comparison_leaves_out_counters_error_flags_and_results():
    def seen(frame: str, *values: str) -> CheckRun:
        run = runs(CheckResult(f"telemetry {frame}", Verdict.PASSED, "", values))
        run.notes = NOTES["cubestar"]
        return run

    for frame, field in (
        ("ExtendedIdentification", "TlmCount"),  # counts
        ("ErrorFlags", "UART_ProtocolError"),  # a flag
        ("ExtendedIdentification", "ResetCause"),  # declared as a state since power-up
        ("DetectionSummary", "NumStarsDetected"),  # in a frame of results
    ):
        assert compare(seen(frame, f"{field}=1"), seen(frame, f"{field}=2")) == [], field
    assert compare(seen("Exposure", "exposure=1"), seen("Exposure", "exposure=2")) != []


def test_declared_results_exist():
    for one in devices():
        for name in one.conformance.results:
            frame, _, field = name.partition(".")
            message = one.interface.telemetry(frame)
            assert not field or message.field(field)


@pytest.mark.parametrize("name", ["Identification", "StarDetails"])
def test_telemetry_with_side_effects_is_requested_once(good, uart, monkeypatch, name):
    run, asked = suite(good, uart), []
    delay(monkeypatch, good, run, lambda payload: not asked.append(payload))
    run.telemetry(good.interface.telemetry(name))
    assert len(asked) == (1 if name == "StarDetails" else 3)

import json

import pytest

from cubestack.emulator.native.compiler import find_compiler
from cubestack.firmware_model.cubesense.state import CameraSettings
from cubestack.host.cli.conformance import _show_text
from cubestack.host.conformance.contract import CheckResult, Verdict

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")


@pytest.fixture
def conformance(run):
    def call(*arguments: str) -> tuple[int, list[dict]]:
        outcome = run("conformance", "--json", *arguments)
        return outcome.code, [json.loads(line) for line in outcome.out.splitlines()]

    return call


def test_details_are_shortened_on_a_terminal_only(capsys, monkeypatch):
    check = CheckResult("a name", Verdict.PASSED, "what was seen, " * 20)
    _show_text(check)
    assert check.detail.strip() in capsys.readouterr().out
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    _show_text(check)
    assert capsys.readouterr().out.rstrip().endswith("...")


@pytest.mark.parametrize("device", ["cubestar", "aramis"])
def test_emulated_device_passes_all_checks(conformance, device):
    code, lines = conformance(f"emulated:{device}", "--allow-write")
    assert [line for line in lines if line.get("outcome") == "failed"] == []
    assert (code, lines[-1]["skipped"]) == (0, 0)
    assert lines[-1]["passed"] > 100


def test_compare_reports_a_changed_default(conformance, monkeypatch):
    code, lines = conformance("emulated:cubesense", "--compare", "emulated:cubesense")
    assert (code, lines[-1]) == (0, {"differences": []})
    reset = CameraSettings.at_reset
    changed = []

    def second_one_differs(camera):
        settings = reset(camera)
        changed.append(camera)
        settings.gain += len(changed) > 2
        return settings

    monkeypatch.setattr(CameraSettings, "at_reset", second_one_differs)
    code, lines = conformance("emulated:cubesense", "--compare", "emulated:cubesense")
    assert code == 1
    shown = {one["check"]: (one["here"], one["there"]) for one in lines[-1]["differences"]}
    assert shown["telemetry Configuration"] == ("Gain1=0, Gain2=0", "Gain1=1, Gain2=1")
    assert {one["kind"] for one in lines[-1]["differences"]} == {"another value"}


def test_conformance_prints_a_text_report(run):
    code, out, _ = run("conformance", "emulated:cubestar")
    assert code == 0
    assert "ok     telemetry Identification" in out
    assert "left out: changes the device: needs --allow-write" in out
    assert "0 failed" in out.splitlines()[-1]


def test_register_uart_does_not_answer_unknown_addresses(conformance):
    code, lines = conformance("emulated:cubesense", "--uart", "registers")
    (silent,) = (line for line in lines if "without a register" in line.get("check", ""))
    assert (code, silent["outcome"], silent["detail"]) == (0, "passed", "no answer")

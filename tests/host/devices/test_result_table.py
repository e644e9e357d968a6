import csv
import io
from collections import Counter
from itertools import islice
from types import SimpleNamespace as Namespace
from typing import Any, cast

import numpy as np
import pytest

from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.host.clients.contract import Client, Columns, DeviceClient
from cubestack.host.devices.registry import device
from cubestack.host.devices.result_table import log_lines, scatter
from cubestack.host.devices.shown_settings import settings
from cubestack.host.errors import NoAnswerError, TargetError
from cubestack.host.targets import Target
from tests.conftest import Run


class Clock:
    now = 100.0
    interface = CUBESENSE

    def pause(self, seconds: float) -> None:
        self.now += seconds


class Measured(DeviceClient):
    """Each result takes 0.3 s; the third is lost."""

    def __init__(self, clock: Clock) -> None:
        self.clock, self.asked = clock, 0
        self.client = clock  # type: ignore[assignment]

    def latest(self) -> Columns:
        self.clock.now += 0.3
        self.asked += 1
        if self.asked == 3:
            raise NoAnswerError("telemetry Result: no answer")
        return {"valid": True, "alpha_deg": 1.5}


def test_log_keeps_its_interval_and_reports_a_lost_answer() -> None:
    clock = Clock()
    lines = list(log_lines(Measured(clock), lambda: clock.now, count=4, interval_s=0.5))
    assert [line["time_s"] for line in lines] == pytest.approx([0, 0.5, 1.0, 1.5])
    assert [line["error"] for line in lines] == [None, None, "telemetry Result: no answer", None]
    assert [line.get("alpha_deg") for line in lines] == [1.5, 1.5, None, 1.5]
    assert all(str(line["utc"]).endswith("+00:00") for line in lines)
    endless = log_lines(Measured(clock), lambda: clock.now, interval_s=0.1)
    assert [line["time_s"] for line in islice(endless, 3)] == pytest.approx([0, 0.3, 0.6])


def test_scatter_is_the_deviation_from_a_straight_line() -> None:
    rng = np.random.default_rng(1)
    times = np.arange(400.0)
    noise = rng.normal(0, 0.02, 400)
    angles = (359 + 0.01 * times + noise) % 360
    lines: list[Columns] = [
        {"time_s": float(t) + 7, "image_time_s": float(t), "ra_deg": float(a), "valid": True}
        for t, a in zip(times, angles, strict=True)
    ]
    lines[5] = {"time_s": 12.0, "image_time_s": 5.0, "ra_deg": None, "valid": False}
    lines[6] = {"time_s": 13.0, "error": "no answer"}
    slope, sigma, count = scatter(lines)["ra_deg"]
    assert slope == pytest.approx(0.01, abs=1e-4)
    assert (sigma, count) == (pytest.approx(0.02, rel=0.1), 398)
    assert scatter(lines[:2]) == {}


def test_device_without_results_is_an_error(either_client: Client) -> None:
    with pytest.raises(TargetError, match="CubeStar has no results to log"):
        DeviceClient(either_client).latest()
    with pytest.raises(TargetError, match="CubeStar is no star tracker"):
        DeviceClient(either_client).take_picture()


def test_log_command_writes_one_line_per_interval(run: Run) -> None:
    code, out, err = run(
        *("log", "emulated:cubesense", "--count", "4", "--interval", "0.5", "--seed", "3"),
        *("-c", "write SUN_THRESHOLD 30", "--each", "write CaptureAndDetect SUN SRAM1; time 0.3"),
    )
    lines = list(csv.DictReader(io.StringIO(out)))
    assert code == 0
    assert [line["time_s"] for line in lines] == ["0.0", "0.5", "1.0", "1.5"]
    assert all(line["sun_detect"] == "SUCCESS" for line in lines)
    assert all(abs(float(line["sun_alpha_deg"]) - 20) < 1 for line in lines)
    assert {line["nadir_alpha_deg"] for line in lines} == {""}
    assert "sun_alpha_deg: 0.0" in err
    assert "4 of 4 lines" in err


def test_errors_before_the_first_result_are_written(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    errors = ["no answer", "busy", None, "late", None]
    lines: list[Columns] = [
        {"time_s": float(number), "error": error} for number, error in enumerate(errors)
    ]
    lines[2]["alpha_deg"] = lines[4]["alpha_deg"] = 1.5
    device = Namespace(client=lambda _node: None)
    none: Any = None
    target = Target("", CUBESENSE, none, device=cast("Any", device))
    shell = Namespace(execute=lambda _command: None)
    for name, it in (("open_any_target", target), ("Shell", shell), ("log_lines", iter(lines))):
        monkeypatch.setattr(
            f"cubestack.host.studies.log.{name}", lambda *_, _it=it, **_options: _it
        )
    code, out, _ = run("log", "emulated:cubesense", "--count", "5")
    written = list(csv.DictReader(io.StringIO(out)))
    assert code == 1
    assert [line["error"] or None for line in written] == errors
    assert [line["alpha_deg"] for line in written] == ["", "", "1.5", "", "1.5"]


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (["emulated:cubesense", "-c", "read nothing"], "nothing is called 'nothing'"),
        (["emulated:cubesense", "--count", "1", "--out", "/no/such/x.csv"], "can not write"),
    ],
)
def test_rejects_invalid_arguments(run: Run, arguments: list[str], error: str) -> None:
    code, out, err = run("log", *arguments)
    assert (code, out) == (2, "")
    assert error in err


CORNERS = ("XMin", "XMax", "YMin", "YMax")


@pytest.mark.parametrize(
    ("name", "telecommand", "places"),
    [
        ("cubestar", "setIDMargin", ["IDMargin.Margin"]),
        ("cubestar", "setPrincipalPoint", ["PrincipalPoint.Cx", "PrincipalPoint.Cy"]),
        ("cubestar", "setTrackingMode", []),  # telemetry has the measured direction
        ("cubesense", "DetectionThreshold2", ["Configuration.Threshold2"]),
        ("cubesense", "Mask2", [f"Masks2.{one}{area}" for area in range(1, 6) for one in CORNERS]),
        ("aramis", "SetGain", ["Gain.Gain"]),
    ],
)
def test_shown_settings_list_each_telemetry_field_of_a_telecommand(
    name: str, telecommand: str, places: list[str]
) -> None:
    sensor = device(name)
    shown = Counter(
        f"{one.frame.name}.{one.shown.name}"
        for one in settings(sensor.interface, sensor.conformance)
        if one.telecommand.name == telecommand
    )
    assert shown == Counter(places)

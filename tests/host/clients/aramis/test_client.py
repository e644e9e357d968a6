from typing import Any
from zlib import crc32

import numpy as np
import pytest

from cubestack.firmware_model.interface import aramis as codes
from cubestack.firmware_model.interface.aramis import INTERFACE, CatalogueState, SensorState
from cubestack.host.clients.aramis.client import Aramis, Star
from cubestack.host.clients.node import NodeClient
from cubestack.host.errors import BadAnswerError, StepFailedError

from ...conftest import FakeNode, UartLink

SOLVED = {
    **{"Q0": 0.5, "Q1": -0.5, "Q2": 0.5, "Q3": 0.5, "Valid": 1, "Matched": 9, "Detected": 12},
    **{"JulianDay": 2_461_366, "Millisecond": 21_600_000, "ImageUptime": 12_345, "FrameCounter": 7},
    "Outcome": codes.MeasurementOutcome.CONCLUSIVE,
    "Reason": codes.Reason.CONFIRMED,
    "Mode": codes.MeasurementMode.AIDED,
}


class FakeAramis(FakeNode):
    """Stores the loaded catalogue in ``memory``."""

    def __init__(self) -> None:
        super().__init__(INTERFACE)
        self.memory = bytearray()
        self.received: set[int] = set()

    def execute(self, name: str, values: dict[str, Any]) -> None:
        if name == "BeginCatalogue":
            self.memory = bytearray(values["Length"])
            self.received.clear()
        if name == "CatalogueBlock":
            start = 128 * values["BlockNumber"]
            self.memory[start : start + 128] = values["Data"][: len(self.memory) - start]
            self.received.add(values["BlockNumber"])
            self.values["UploadStatus"]["BlocksReceived"] = len(self.received)
        if name == "Activate":
            self.values["SensorStatus"] = {"State": SensorState.READY, "Catalogue": 1}


@pytest.fixture
def node() -> FakeAramis:
    return FakeAramis()


@pytest.fixture
def aramis(node: FakeAramis) -> Aramis:
    return Aramis(NodeClient(UartLink(node), INTERFACE))


def test_quality_returns_reason_false_alarm_and_sigmas(node: FakeAramis, aramis: Aramis) -> None:
    node.values["Quality"] = {
        **{"Valid": 1, "Reason": codes.Reason.CONFIRMED, "LogFalseAlarm": -12.5},
        **{"Matched": 9, "Expected": 11, "Residual": 0.125},
        **{"SigmaX": 1e-5, "SigmaY": 2e-5, "SigmaZ": 1e-4},
        **{"CorrelationXY": 0.25, "CorrelationXZ": -0.5, "CorrelationYZ": 0.125},
        **{"Scale": 1.0, "Background": 2.5, "Noise": 1.5, "Spread": 3.0, "Blind": 0.25},
        **{"Spikes": 70_000, "Rejected": 3},
    }
    found = aramis.quality()
    assert (found.valid, found.reason) == (True, codes.Reason.CONFIRMED)
    np.testing.assert_allclose(found.sigmas_rad, [1e-5, 2e-5, 1e-4], rtol=1e-5)
    np.testing.assert_array_equal(found.covariance, found.covariance.T)
    correlation = found.covariance / np.outer(found.sigmas_rad, found.sigmas_rad)
    np.testing.assert_allclose(correlation[0], [1, 0.25, -0.5], rtol=1e-6)
    assert found.false_alarm == pytest.approx(10**-12.5, rel=1e-6)
    assert (found.residual_rad, found.blind) == (0.125, 0.25)
    assert (found.matched, found.expected, found.spikes, found.rejected) == (9, 11, 70_000, 3)


def test_activate_returns_the_catalogue_state(node: FakeAramis, aramis: Aramis) -> None:
    node.busy = 3
    assert aramis.activate() is CatalogueState.GOOD
    node.execute = lambda name, values: None  # type: ignore[method-assign]
    node.values["SensorStatus"] = {"State": SensorState.ACTIVATING}
    with pytest.raises(StepFailedError, match="not ready after Activate: ACTIVATING"):
        aramis.activate()


def test_attitude_returns_quaternion_outcome_and_times(node: FakeAramis, aramis: Aramis) -> None:
    node.values["Attitude"] = dict(SOLVED)
    found = aramis.attitude()
    np.testing.assert_allclose(found.quaternion, [0.5, -0.5, 0.5, 0.5])
    assert (found.valid, found.matched, found.detected, found.frame) == (True, 9, 12, 7)
    assert found.outcome is codes.MeasurementOutcome.CONCLUSIVE
    assert (found.reason, found.mode) == (SOLVED["Reason"], SOLVED["Mode"])
    assert (found.image_uptime_s, found.julian_date) == (12.345, 2_461_366.25)


def test_unset_attitude_and_time_are_none(aramis: Aramis) -> None:
    found = aramis.attitude()
    assert (found.quaternion, found.valid, found.julian_date) == (None, False, None)
    assert found.reason is codes.Reason.NOT_MEASURED
    assert aramis.body_quaternion() is None
    assert aramis.julian_date() is None


@pytest.mark.parametrize(
    ("arguments", "command", "parameters"),
    [
        ({}, "GetAttitude", {}),
        ({"near": [0.6, 0.0, 0.8]}, "GetAttitudeNearVector", {"X": 0.6, "Y": 0.0, "Z": 0.8}),
        ({"near_rad": (1.5, -0.5)}, "GetAttitudeNearPoint",
         {"RightAscension": 1.5, "Declination": -0.5}),
    ],
)  # fmt: skip
def test_measure_sends_the_known_direction(
    node: FakeAramis, aramis: Aramis, arguments: Any, command: str, parameters: dict[str, float]
) -> None:
    node.values["Attitude"] = dict(SOLVED)
    node.busy = 2
    assert aramis.measure(**arguments).valid
    assert node.log[-1] == (command, pytest.approx(parameters))


def test_julian_dates_are_split_exactly(node: FakeAramis, aramis: Aramis) -> None:
    for more, days, millisecond in (
        (0.25, 0, 21_600_000),
        (0.0, 0, 0),
        (1 - 4e-9, 1, 0),  # 0.3 ms before the next day begins
    ):
        assert (2_461_366 + more) // 1 == 2_461_366
        aramis.set_time(2_461_366 + more)
        sent = {"JulianDay": 2_461_366 + days, "Millisecond": millisecond}
        assert node.log[-1] == ("SetSystemTime", sent)


def test_latch_up_action_sends_off_then_on(node: FakeAramis, aramis: Aramis) -> None:
    aramis.latch_up_action()
    assert [values["Step"] for name, values in node.log] == [0, 1]


def test_load_catalogue_sends_every_block(node: FakeAramis, aramis: Aramis) -> None:
    image = bytes(range(256)) + b"tail"
    node.values["CatalogueStatus"]["State"] = CatalogueState.GOOD
    seen: list[tuple[int, int]] = []
    assert aramis.load_catalogue(image, lambda *done: seen.append(done)) is CatalogueState.GOOD
    assert bytes(node.memory) == image
    assert node.log[0] == ("BeginCatalogue", {"Length": 260, "Checksum": crc32(image)})
    assert seen == [(1, 3), (2, 3), (3, 3)]


def test_load_catalogue_reports_rejected_and_incomplete_uploads(node: Any, aramis: Any) -> None:
    node.values["ErrorFlags"]["UploadError"] = True
    with pytest.raises(StepFailedError, match="rejected"):
        aramis.load_catalogue(b"x" * 10)
    node.execute = lambda name, values: None
    with pytest.raises(StepFailedError, match="1 blocks arrived of 3"):
        aramis.load_catalogue(b"x" * 300)


def test_stars_are_ordered_and_an_incomplete_list_is_rejected(node: Any, aramis: Any) -> None:
    node.values["DetectionSummary"] = {"Detected": 2}
    first = {"StarNumber": 0, "X": 1.0, "Y": 2.0, "Brightness": 99.0}
    second = {"StarNumber": 1, "X": 3.5, "Y": 4.0, "Brightness": 50.0}
    node.records["StarDetails"] = [second, first | {"Identified": 1, "Hipparcos": 24436}]
    assert aramis.stars() == [Star(0, 1.0, 2.0, 99.0, 24436), Star(1, 3.5, 4.0, 50.0, None)]
    node.records["StarDetails"] = [{"StarNumber": 1}]
    node._steps.clear()
    with pytest.raises(BadAnswerError, match="1 stars of 2 came"):
        aramis.stars()


def test_phase_times_in_ms(node: FakeAramis, aramis: Aramis) -> None:
    node.values["PhaseTimes"] = {"Spikes": 355_388, "Total": 519_668}
    times = aramis.phase_times()
    assert (times["spikes"], times["total"], times["faces"]) == (355.388, 519.668, 0)


def test_latest_returns_a_log_line(aramis: Aramis, node: Any) -> None:
    node.values["Attitude"] = dict(SOLVED)
    line = aramis.latest()
    assert (line["valid"], line["q1"], line["matched"]) == (True, -0.5, 9)
    assert (line["image_time_s"], line["julian_date"]) == (12.345, 2_461_366.25)
    assert (line["outcome"], line["reason"]) == ("CONCLUSIVE", "CONFIRMED")
    node.values["Attitude"]["Valid"] = 0
    assert (aramis.latest()["q1"], list(aramis.latest())) == (None, list(line))

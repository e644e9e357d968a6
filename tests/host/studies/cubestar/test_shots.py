from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cubestack.firmware_model.interface.cubestar import MatchMode, TaskStatus
from cubestack.host.experiments.cubestar import measure
from cubestack.host.studies.cubestar.shots import _shot

TELEMETRY = {"DetectionSummary": {"NumStarsDetected": 9}, "NumIdStars": {"numIdStars": 4}}


@pytest.mark.parametrize(
    ("judged", "valid", "status", "stars"),
    [
        (False, True, TaskStatus.CALCULATED, (7, 0)),
        (False, False, TaskStatus.CALCULATION_FAILED, (0, 0)),
        (True, True, TaskStatus.CALCULATED, (4, 2)),
        (True, False, TaskStatus.CALCULATION_FAILED, (4, 2)),
        (True, False, TaskStatus.IDENTIFICATION_FAILED, (0, 0)),
    ],
)
def test_identities_are_judged_only_where_stars_are_identified(
    monkeypatch: pytest.MonkeyPatch,
    judged: bool,
    valid: bool,
    status: TaskStatus,
    stars: tuple[int, int],
) -> None:
    truth = np.array([0.0, 0.0, 0.0, 1.0])
    attitude = SimpleNamespace(
        valid=valid, quaternion=truth, matched=7, mode=MatchMode.LOST_IN_SPACE
    )
    cubestar = SimpleNamespace(
        capture_and_process=lambda: status,
        attitude=lambda: attitude,
        client=SimpleNamespace(telemetry=TELEMETRY.__getitem__),
    )
    device: Any = SimpleNamespace(client=cubestar, board=SimpleNamespace(truth=lambda: truth))
    monkeypatch.setattr(measure, "count_wrong", lambda *_: 2)
    shot = _shot(device, judged=judged)
    assert (shot.valid, shot.right, shot.detected) == (valid, valid, 9)
    assert (shot.matched, shot.wrong) == stars

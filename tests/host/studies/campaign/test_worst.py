from pathlib import Path

from cubestack.host.studies.campaign.folder import Folder, run
from cubestack.host.studies.campaign.plan import CampaignPlan
from cubestack.host.studies.campaign.worst import worst


def test_worst_cases_are_sorted_by_outcome(
    tmp_path: Path, plan: CampaignPlan, failing: set[float]
) -> None:
    failing.add(0.9)
    folder = Folder.begun(tmp_path / "c", plan, resume=False)
    rows = list(run(folder, 1))
    cases = list(worst(folder, len(rows)))
    outcomes = [list(folder.rows())[case.number].outcome for case in cases]
    order = ["failed", "wrong", "refused", "right"]
    assert outcomes == sorted(outcomes, key=order.index)
    assert {"failed", "right"} <= set(outcomes)
    assert all(case.text.startswith(outcome) for case, outcome in zip(cases, outcomes, strict=True))
    assert not any(case.jpeg for case in cases)  # nothing was powered up


def test_worst_case_of_a_real_device_has_its_picture(tmp_path: Path) -> None:
    plan = CampaignPlan(device="cubestar", frames=2, options={"mag_limit": 3.8})
    folder = Folder.begun(tmp_path / "c", plan, resume=False)
    first, second = (row.result["error_cross_deg"] for row in run(folder, 1))
    (case,) = worst(folder, 1)
    assert case.number == int(second > first)
    assert case.jpeg.startswith(b"\xff\xd8")

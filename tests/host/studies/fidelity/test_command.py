from types import SimpleNamespace

import pytest

from cubestack.host.studies.fidelity import command as fidelity
from cubestack.host.studies.fidelity.table import Job


def test_remaining_time_scales_with_the_time_so_far(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Jobs of 10, 20 and 30 s on a machine that needs twice as long."""
    clock = iter([100.0, 120.0, 160.0, 220.0])
    monkeypatch.setattr(fidelity, "time", SimpleNamespace(monotonic=lambda: next(clock)))
    jobs = [Job("cubestar", f"of {n}", "published", 1, n) for n in (10.0, 20.0, 30.0)]
    told = fidelity._Rest(jobs, quiet=False)
    assert [told(job) for job in jobs] == [1, 2, 3]
    times = [line.split("published: ")[1] for line in capsys.readouterr().err.splitlines()]
    assert times == [
        f"{took} s, about {rest} s to go" for took, rest in ((20, 100), (60, 60), (120, 0))
    ]


def test_quiet_counts_without_output(capsys: pytest.CaptureFixture[str]) -> None:
    job = Job("cubestar", "loop", "published", 1, 10.0)
    told = fidelity._Rest([job, job], quiet=True)
    assert [told(job), told(job)] == [1, 2]
    assert capsys.readouterr() == ("", "")

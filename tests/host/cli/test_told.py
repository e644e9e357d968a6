import argparse
import json
import logging
import signal
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.emulator.native.compiler import CompilerError
from cubestack.firmware_model.values import whole
from cubestack.host.cli import main as entry
from cubestack.host.cli import measure
from cubestack.host.devices.experiment import Experiment, Result
from cubestack.host.devices.registry import device, device_names
from cubestack.host.options import Options
from cubestack.host.studies.campaign import command as campaign
from cubestack.host.studies.campaign.statistics import Change
from cubestack.host.studies.hazards import command as hazards
from cubestack.host.studies.hazards.curves import Point
from tests.conftest import Run

# --- any command ----------------------------------------------------------------------------------


@pytest.fixture
def ending(monkeypatch: pytest.MonkeyPatch) -> list[BaseException | int | None]:
    """How `bench` ends: an exception or its exit status."""
    ends = list[BaseException | int | None]()

    def run(_args: argparse.Namespace) -> int | None:
        (end,) = ends
        if isinstance(end, BaseException):
            raise end
        return end

    monkeypatch.setattr("cubestack.host.studies.bench.run", run)
    return ends


@pytest.mark.parametrize(
    ("end", "code", "error"),
    [
        *((status, status or 0, "") for status in (None, 0, 1)),
        (KeyboardInterrupt(), 130, ""),
        (BrokenPipeError(), 1, ""),
        (ValueError("3 is no colour"), 2, "cubestack bench: 3 is no colour\n"),
        (OSError("no disk"), 1, "cubestack bench: no disk\n"),
        (CompilerError("no compiler"), 1, "cubestack bench: no compiler\n"),
    ],
)
def test_exit_status_and_error_line_follow_from_how_a_command_ends(
    run: Run, ending: list[Any], end: Any, code: int, error: str
) -> None:
    ending.append(end)
    assert run("bench") == (code, "", error)


def test_unexpected_exception_keeps_its_traceback(run: Run, ending: list[Any]) -> None:
    ending.append(RuntimeError("impossible"))
    with pytest.raises(RuntimeError, match="impossible"):
        run("bench")


@pytest.mark.parametrize(
    ("words", "level"),
    [
        ([], logging.WARNING),
        (["-v"], logging.INFO),
        (["-vv"], logging.DEBUG),
        (["-vvv"], logging.DEBUG),
        (["-q"], logging.ERROR),
    ],
)
def test_log_level_is_set_during_the_command_and_restored_after(
    run: Run, monkeypatch: pytest.MonkeyPatch, words: list[str], level: int
) -> None:
    from cubestack.host import terminal

    def state() -> tuple[int, int, bool]:
        return own.level, len(own.handlers), terminal._errors.quiet

    own, during = logging.getLogger("cubestack"), list[tuple[int, int, bool]]()
    command = "cubestack.host.studies.bench.run"
    monkeypatch.setattr(command, lambda _: during.append(state()))
    before = state()
    assert run(*words, "bench").code == 0
    assert during == [(level, before[1] + 1, "-q" in words)]
    assert state() == before


def test_only_signals_with_the_default_handler_are_handled(monkeypatch: pytest.MonkeyPatch) -> None:
    taken = {signal.SIGTERM: signal.SIG_DFL, signal.SIGHUP: signal.SIG_IGN}
    monkeypatch.setattr(signal, "getsignal", taken.__getitem__)
    monkeypatch.setattr(signal, "signal", taken.__setitem__)
    entry._end_in_order()
    assert taken[signal.SIGHUP] is signal.SIG_IGN
    handler: Any = taken[signal.SIGTERM]
    with pytest.raises(SystemExit) as end:
        handler(signal.SIGTERM, None)
    assert end.value.code == 128 + 15


def test_help_examples_name_registered_devices() -> None:
    first, second, third = device_names()[:3]
    assert entry._with_names("a {first} b {second} {third} {fourth}") == (
        f"a {first} b {second} {third} {{fourth}}"
    )


# --- experiments ----------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Wanted(Options):
    frames: int = whole(1, "number", 1)


@dataclass(frozen=True)
class Number(Result):
    number: int
    right: bool = True


class Counting(Experiment[Any, Wanted, Number]):
    """Counts, up to ``stop``."""

    options = Wanted
    description = "Counts."
    title = "numbers"
    columns = ("number", "twice")
    label = "counting"
    stop: int | None = None
    good = True

    def count(self, options: Wanted) -> int:
        return options.frames

    def run(self, opened: Any, options: Wanted) -> Iterator[Number]:
        for number in range(options.frames):
            if number == self.stop:
                raise KeyboardInterrupt
            yield Number(number)

    def row(self, number: int, result: Number) -> tuple[str, ...]:
        return (str(result.number), str(2 * result.number))

    def summarise(self, results: Sequence[Number], wall_s: float) -> Iterator[str]:
        yield f"{len(results)} results in {'no' if wall_s < 0 else 'some'} time"

    def succeeded(self, results: Sequence[Number]) -> bool:
        return self.good


def counted(experiment: Counting, frames: int, *, as_json: bool = False, **more: Any) -> int:
    args = argparse.Namespace(frames=frames, json=as_json, **more)
    return measure.run_experiment(args, device("aramis"), experiment)


def test_table_shows_the_first_40_results_and_the_summary(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert counted(Counting(), 43) == 0
    out = capsys.readouterr().out
    lines = [line.split() for line in out.splitlines()]
    assert out.startswith("numbers")
    assert ["number", "twice"] in lines
    assert [[str(n), str(2 * n)] in lines for n in (0, 39, 40)] == [True, True, False]
    assert "... and 3 more; --json lists them all" in out
    assert out.endswith("43 results in some time\n")
    counted(Counting(), 40)
    assert "more" not in capsys.readouterr().out


def test_json_prints_one_line_per_result_with_its_profile(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert counted(Counting(), 3, as_json=True) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert [json.loads(line)["number"] for line in out.splitlines()] == [0, 1, 2]
    assert {json.loads(line)["profile"] for line in out.splitlines()} == {"published"}


def test_failed_experiment_exits_with_1_and_has_no_sections(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert list(Counting().sections([{"number": 1}])) == []
    monkeypatch.setattr(Counting, "good", False)
    assert counted(Counting(), 1) == 1


@pytest.mark.parametrize("as_json", [False, True])
def test_interrupted_experiment_shows_the_results_so_far(
    as_json: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(Counting, "stop", 2)
    with pytest.raises(KeyboardInterrupt):
        counted(Counting(), 5, as_json=as_json)
    out, err = capsys.readouterr()
    assert err.splitlines()[-1] == "stopped after 2 of 5"
    assert ("2 results in some time" in out) != as_json
    monkeypatch.setattr(Counting, "stop", 0)
    with pytest.raises(KeyboardInterrupt):
        counted(Counting(), 5)
    assert capsys.readouterr().out == ""


def test_min_right_rejects_results_without_a_verdict(monkeypatch: pytest.MonkeyPatch) -> None:
    @dataclass(frozen=True)
    class Silent(Result):
        number: int

    monkeypatch.setattr(Counting, "run", lambda *_of: iter([Silent(1)]))
    with pytest.raises(ValueError, match="results of aramis do not say what is right: no --min"):
        counted(Counting(), 1, min_right=50.0)


# --- hazards --------------------------------------------------------------------------------------

POINTS = [
    Point("cubestar", "extended", "moon", 7.5, 20, 0, 13, 6, 1, {"too few": 4, "dark": 2}),
    Point("aramis", "extended", "moon", 0.0, 20, 0, 20, 0, 0, {}),
]


def test_hazards_table_shows_confidence_limits(
    run: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    asked = list[Any]()

    def measured(jobs: Sequence[Any], workers: int) -> Iterator[Point]:
        asked.append((jobs, workers))
        yield from POINTS

    monkeypatch.setattr(hazards.curves, "run", measured)
    monkeypatch.setattr(hazards, "cores", lambda: 999)
    told = run("hazards", "cubestar", "--hazard", "moon", "--frames", "20", "--seed", "3")
    ((jobs, workers),) = asked
    assert workers == len(jobs) > 2
    assert {(job.device, job.hazard, job.frames, job.seed) for job in jobs} == {
        ("cubestar", "moon", 20, 3)
    }
    assert told.code == 0
    assert "13 (43-82 %)" in told.out
    assert "1 (1-24 %)" in told.out
    assert "too few 4, dark 2" in told.out
    assert "7.5" in told.out
    assert "20 (84-100 %)" in told.out
    run("hazards", "cubestar", "--hazard", "moon", "--workers", "1")
    assert asked[-1][1] == 1
    listed = run("hazards", "cubestar", "--hazard", "moon", "--json").out.splitlines()
    assert [json.loads(line)["right"] for line in listed] == [13, 20]


def test_hazards_measures_all_devices_by_default(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = list[Any]()
    monkeypatch.setattr(hazards.curves, "run", lambda jobs, _workers: asked.extend(jobs) or [])
    assert run("hazards", "--hazard", "fog", "--json").code == 2
    assert run("hazards", "--hazard", "defocus", "--json").code == 0
    assert {job.device for job in asked} == set(hazards.curves.devices_with_hazards())


def test_list_shows_the_strengths_of_each_hazard(run: Run) -> None:
    from cubestack.host.experiments.hazard_options import known

    lines = run("hazards", "--list").out.splitlines()
    for name, kind in known().items():
        (line,) = (one for one in lines if one.split()[:1] == [name])
        assert kind.meaning in line
        assert ", ".join(f"{value:g}" for value in kind.strength.values) in line


# --- campaigns ------------------------------------------------------------------------------------


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """A stub of a campaign with given rows and results."""
    ended = {(("stars", 3),): Counter(right=3, wrong=1), (("stars", 9),): Counter(refused=4)}
    made = SimpleNamespace(
        path=tmp_path / "c",
        plan=SimpleNamespace(grid={"stars": [3, 9]}),
        rows=lambda: iter([1, 2]),
        ended=ended,
        stop=None,
        asked=[],
    )

    def run(_folder: Any, workers: int, scheduler: str | None) -> Iterator[int]:
        made.asked.append((workers, scheduler))
        yield from range(3)
        if made.stop is not None:
            raise made.stop

    monkeypatch.setattr(campaign.CampaignPlan, "read", lambda path: path)
    monkeypatch.setattr(campaign.Folder, "begun", lambda *_of, **_how: made)
    monkeypatch.setattr(campaign, "count", lambda _plan: 8)
    monkeypatch.setattr(campaign, "run_into", run)
    monkeypatch.setattr(campaign.statistics, "rates", lambda _folder: made.ended)
    (tmp_path / "plan.toml").write_text("", "utf-8")
    monkeypatch.chdir(tmp_path)
    return made


def test_campaign_prints_rates_with_confidence_limits(run: Run, folder: SimpleNamespace) -> None:
    told = run("campaign", "plan.toml", "--workers", "2")
    assert told.code == 0
    rows = [line.split() for line in told.out.splitlines()]
    assert ["stars", "right", "refused", "wrong", "failed"] in rows
    assert any(row[:3] == ["3", "3", "30.1-95.4"] for row in rows)
    assert folder.asked == [(2, None)]
    lines = run("campaign", "plan.toml", "--json", "--scheduler", "tcp://x").out.splitlines()
    assert [json.loads(line) for line in lines] == [
        {"point": {"stars": 3}, "of": 4, "right": 3, "wrong": 1},
        {"point": {"stars": 9}, "of": 4, "refused": 4},
    ]
    assert folder.asked[-1][1] == "tcp://x"
    assert folder.asked[-1][0] >= 1


def test_failed_frames_are_reported_and_exit_with_1(run: Run, folder: SimpleNamespace) -> None:
    folder.ended = {(("stars", 3),): Counter(failed=2), (("stars", 9),): Counter(failed=1, right=1)}
    told = run("campaign", "plan.toml")
    assert told.code == 1
    assert f'3 failed: "outcome": "failed" in {folder.path}; replay shows how' in told.err


@pytest.mark.parametrize(("stop", "code"), [(KeyboardInterrupt(), 130), (OSError("full"), 1)])
def test_stopped_campaign_explains_how_to_resume(
    run: Run, folder: SimpleNamespace, stop: BaseException, code: int
) -> None:
    folder.stop = stop
    told = run("campaign", "plan.toml")
    assert told.code == code
    assert f"3 of 8 results are in {folder.path}; --resume continues" in told.err


def test_list_shows_the_shipped_plans(run: Run) -> None:
    plain, data = run("campaign", "--list"), run("campaign", "--list", "--json")
    told = [json.loads(line) for line in data.out.splitlines()]
    assert len(told) == len(plain.out.splitlines()) > 3
    for one, line in zip(told, plain.out.splitlines(), strict=True):
        assert line.split()[0] == one["plan"]
        assert line.endswith(one["what"])
    assert plain.code == data.code == 0


@pytest.mark.parametrize("as_json", [False, True])
@pytest.mark.parametrize("worse", [False, True])
def test_campaign_report_prints_what_got_worse(
    run: Run, folder: SimpleNamespace, monkeypatch: pytest.MonkeyPatch, worse: bool, as_json: bool
) -> None:
    changes = [
        Change((("stars", 3),), "right", 9, 9, 0, 0, 1.0, False),
        Change((("stars", 9),), "right", 9, 2, 7, 0, 0.001, worse),
    ]
    monkeypatch.setattr(campaign, "Folder", lambda path: path)
    monkeypatch.setattr(campaign, "compared", lambda *_of: changes)
    monkeypatch.setattr(campaign, "worst", lambda *_of: iter([]))
    files = [Path("report.html"), Path("a.png"), Path("b.png")]
    monkeypatch.setattr(campaign.report, "write", lambda *_of: files)
    words = ["campaign", "report", "c", "--compare", "d"]
    told = run(*words, *(["--json"] if as_json else []))
    assert told.code == int(worse)
    assert "wrote report.html and 2 figures" in told.err
    if as_json:
        assert [json.loads(line)["before"] for line in told.out.splitlines()] == [9, 9]
    else:
        line = "stars = 9: right 9 before, 2 after: worse\n"
        assert told.out == (line if worse else "")

import re
from base64 import b64decode
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path
from typing import Any

import pytest
import scipy  # which loads its parts when they are used
from PIL import Image

from cubestack.host.devices.experiment import Section
from cubestack.host.studies.campaign import report
from cubestack.host.studies.campaign.block import Row
from cubestack.host.studies.campaign.folder import Folder, FolderError, run
from cubestack.host.studies.campaign.plan import CampaignPlan
from cubestack.host.studies.campaign.report import worst
from cubestack.host.studies.campaign.statistics import by_chance, compared, errors, rates

Make = Callable[..., Folder]
FRAMES = 120


@pytest.fixture
def make(tmp_path: Path) -> Make:
    """Makes folders of given outcomes by block and row; others are right."""

    def begun(
        name: str, others: dict[str, str], seed: int = 5, errors: Sequence[str] = ("error_deg",)
    ) -> Folder:
        grid = {"false_stars": [0, 9], "hazard": [["moon"]]}
        plan = CampaignPlan(device="cubestar", frames=FRAMES, seed=seed, block=FRAMES, grid=grid)
        folder = Folder.begun(tmp_path / name, plan, resume=False)
        for block in plan.blocks():
            rows = []
            for row in range(FRAMES):
                outcome = others.get(f"{block.number}.{row}", "right")
                size = -0.01 * (row + 1)
                measured = dict.fromkeys(errors, size) | {"centroids": 8}
                result = measured if outcome != "failed" else {}
                reason = "<b>broken</b>" if outcome == "failed" else ""
                key = (block.number, row, block.seed, row)
                rows.append(Row(*key, block.swept, outcome, reason, result))
            folder.add(rows)
        return folder

    return begun


def some(outcome: str, count: int, block: int = 1) -> dict[str, str]:
    return {f"{block}.{row}": outcome for row in range(count)}


def test_rates_and_errors_count_the_rows(make: Make) -> None:
    folder = make("a", some("refused", 20) | {"0.5": "failed"})
    few, many = rates(folder).values()
    assert (few["right"], few["failed"], many["right"], many["refused"]) == (119, 1, 100, 20)
    (points,) = errors(folder).values()
    sizes = list(points.values())
    assert [len(values) for values in sizes] == [119, 100]
    assert sizes[1] == sorted(sizes[1])
    assert sizes[1][0] == pytest.approx(0.21)


@pytest.mark.parametrize(("one", "other"), [(0, 0), (0, 1), (3, 9), (9, 3), (40, 41), (0, 30)])
def test_by_chance_equals_a_binomial_test(one: int, other: int) -> None:
    expected = scipy.stats.binomtest(one, one + other).pvalue if one + other else 1.0
    assert by_chance(one, other) == pytest.approx(expected)


def test_comparison_finds_the_point_that_changed(make: Make) -> None:
    before, after = make("before", {}), make("after", some("refused", 20) | {"0.3": "wrong"})
    changes = {
        (dict(each.point)["false_stars"], each.outcome): each for each in compared(before, after)
    }
    assert {key for key, each in changes.items() if each.worse} == {(9, "right")}
    assert not changes[0, "wrong"].significant
    assert changes[0, "wrong"].chance == 1.0
    assert (changes[9, "right"].before, changes[9, "right"].after) == (120, 100)
    back = [each for each in compared(after, before) if each.significant]
    assert [(each.outcome, each.worse) for each in back] == [("right", False)]


def test_campaign_comparison_marks_more_wrong_attitudes_as_worse(make: Make) -> None:
    changes = compared(make("before", {}), make("after", some("wrong", 30)))
    assert [each.outcome for each in changes if each.worse] == ["right", "wrong"]


def test_comparison_needs_the_same_skies(make: Make, tmp_path: Path) -> None:
    before = make("before", {})
    other = make("other", {}, seed=6)
    with pytest.raises(FolderError, match=r"other skies than .*: another seed"):
        compared(before, other)
    plan = CampaignPlan(device="cubestar", frames=2, grid={"false_stars": [1]})
    with pytest.raises(FolderError, match="not the same grid and as many rows"):
        compared(before, Folder.begun(tmp_path / "less", plan, resume=False))


class Page(HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.sources: list[str] = []
        self.cells: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert tag not in ("script", "link", "b")
        self.sources += [value or "" for name, value in attrs if name in ("src", "href")]

    def handle_data(self, data: str) -> None:
        self.cells.append(data)


def test_report_page_is_self_contained(make: Make) -> None:
    folder = make("a", some("refused", 20) | {"0.5": "failed"})
    page, *figures = report.write(folder)
    assert [figure.name for figure in figures] == ["rates-false_stars.png", "error_deg.png"]
    text = page.read_text("utf-8")
    told = Page(text)
    assert len(told.sources) == len(figures)
    for source, figure in zip(told.sources, figures, strict=True):
        data = b64decode(source.removeprefix("data:image/png;base64,"))
        assert data == figure.read_bytes()
        with Image.open(BytesIO(data)) as image:
            assert image.width > 400
    assert not re.search(r"https?://", text)
    assert "<b>broken</b>" in told.cells
    limits = scipy.stats.binomtest(100, FRAMES).proportion_ci(0.95, "wilson")
    assert f"100 ({100 * limits.low:.2f} to {100 * limits.high:.2f} %)" in told.cells
    assert "false_stars = 9, hazard = ('moon',)" in told.cells


def test_published_errors_are_marked_on_their_own_curve(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = dict[str, list[float]]()

    def curves(name: str, _errors: object, marks: Sequence[tuple[float, str]]) -> bytes:
        drawn[name] = [value for value, _text in marks]
        return b""

    monkeypatch.setattr(report, "error_curves", curves)
    monkeypatch.setattr(report, "rate_curves", lambda *_drawn: b"")
    report.write(make("a", {}, errors=("error_deg", "error_cross_deg", "error_roll_deg")))
    assert drawn == {
        "error_deg": [],
        "error_cross_deg": [0.0083, 0.004],
        "error_roll_deg": [0.0203],
    }


def test_browser_shows_the_report_without_further_requests(make: Make, chromium: Any) -> None:
    page, *figures = report.write(make("a", some("refused", 20)))
    tab, asked = chromium.new_page(), list[str]()
    tab.on("request", lambda one: asked.append(one.url))
    tab.goto(page.as_uri())
    widths = tab.evaluate("[...document.images].map((image) => image.naturalWidth)")
    assert len(widths) == len(figures)
    assert min(widths) > 400
    assert [url for url in asked if not url.startswith("data:")] == [page.as_uri()]
    tab.close()


def test_report_page_shows_the_comparison(make: Make) -> None:
    before, after = make("before", {}), make("after", some("refused", 20))
    page, *_ = report.write(after, compared(before, after), before.path)
    cells = Page(page.read_text("utf-8")).cells
    assert cells.count("worse") == 1
    assert f"Compared with {before.path}" in cells


def test_report_rejects_a_campaign_without_rows(folder: Folder) -> None:
    with pytest.raises(ValueError, match="has no rows yet"):
        report.write(folder)


def test_worst_cases_are_sorted_by_outcome(folder: Folder, failing: set[float]) -> None:
    failing.add(0.9)
    rows = list(run(folder, 1))
    cases = list(worst(folder, len(rows)))
    outcomes = [list(folder.rows())[case.number].outcome for case in cases]
    order = ["failed", "wrong", "refused", "right"]
    assert outcomes == sorted(outcomes, key=order.index)
    assert {"failed", "right"} <= set(outcomes)
    assert all(case.text.startswith(outcome) for case, outcome in zip(cases, outcomes, strict=True))
    assert not any(case.jpeg for case in cases)  # nothing was powered up


@pytest.mark.usefixtures("failing")
def test_report_has_the_sections_of_the_experiment(
    folder: Folder, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib")
    list(run(folder, 1))
    seen = list[Any]()

    class Tested:
        marks = ()

        def sections(self, results: Iterator[Any]) -> Iterator[Section]:
            seen.extend(results)
            yield Section("by part & kind", ("part", "how often"), [("a<b", "7"), ("c", "9")])
            yield Section("as a figure", png=b"\x89PNG figure")

    monkeypatch.setattr(report, "experiment_of", lambda *_of: Tested())
    page, *figures = report.write(folder)
    text = page.read_text("utf-8")
    assert "<h2>by part &amp; kind</h2>" in text
    assert "<tr><th>part</th><th>how often</th></tr>" in text
    assert "<tr><td>a&lt;b</td><td>7</td></tr>\n<tr><td>c</td><td>9</td></tr>" in text
    assert figures[-1].name == "as-a-figure.png"
    assert figures[-1].read_bytes() == b"\x89PNG figure"
    assert 'alt="as a figure"' in text
    assert len(seen) == len(list(folder.rows()))


def test_worst_case_has_the_largest_error(
    folder: Folder, failing: set[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    failing.add(0.9)
    rows = [
        replace(row, outcome="right", result={"error_deg": error, "other": 99.0})
        for row, error in zip(run(folder, 1), (0.5, -3.0, None, 1.0, 2.0), strict=False)
    ]
    monkeypatch.setattr(Folder, "rows", lambda _folder: iter(rows))
    monkeypatch.setattr("cubestack.host.studies.campaign.report._picture", lambda *_of: b"")
    cases = list(worst(folder, 4))
    assert [case.number for case in cases] == [1, 4, 3, 0]
    assert "error_deg 3" in cases[0].text
    assert "other" not in cases[0].text
    assert "false_stars = 0" in cases[0].text


def test_worst_replays_failures_and_raises_new_ones(folder: Folder, failing: set[float]) -> None:
    failing.add(0.5)
    rows = list(run(folder, 1))
    assert {"failed"} < {row.outcome for row in rows}
    (case,) = worst(folder, 1)
    assert case.text.startswith("failed; IndexError: drawn")
    assert case.jpeg == b""
    failing.add(-1.0)  # now all of them fail
    with pytest.raises(IndexError):
        list(worst(folder, len(rows)))


def test_worst_case_of_an_emulated_device_has_its_image(tmp_path: Path) -> None:
    plan = CampaignPlan(device="cubestar", frames=2, options={"mag_limit": 3.8})
    folder = Folder.begun(tmp_path / "c", plan, resume=False)
    first, second = (row.result["error_cross_deg"] for row in run(folder, 1))
    (case,) = worst(folder, 1)
    assert case.number == int(second > first)
    assert case.jpeg.startswith(b"\xff\xd8")

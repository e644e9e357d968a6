"""Figures within the text of pages."""

from pathlib import Path

import pytest

from cubestack.host.devices.registry import BUILT_IN
from cubestack.host.studies.fidelity.recorded import all_jobs, rows_of
from cubestack.host.studies.fidelity.text import (
    filled,
    missing,
    names_in,
    pages_with_figures,
    stored_in,
)
from cubestack.host.studies.rows.estimate import Estimate
from cubestack.host.studies.rows.record import measurement, save

DOCS = Path(__file__).parents[4] / "docs"
PAGES = pages_with_figures(DOCS)

TEXT = """above

<!-- figures
It is {walk: slow, published: speed: .1f} m/s, or {walk: slow, published: speed: .0f alone};
{walk: slow, published: 5 deg far: .2f} elsewhere.
-->

It is fast.

<!-- end of figures -->

below {not: a: name: here}
"""

NEW = """
It is 2.5 (2.0 to 3.0) m/s, or 2;
- elsewhere.
"""


@pytest.fixture
def page(tmp_path: Path) -> Path:
    figures = {"speed": Estimate(2.5, 2.0, 3.0), "5 deg far": float("nan")}
    save(tmp_path / "data" / "walk.json", {"slow, published": measurement("w", 1.0, figures, [])})
    path = tmp_path / "how" / "page.md"
    path.parent.mkdir()
    path.write_text(TEXT, "utf-8")
    return path


def test_text_below_the_comment_is_replaced(page: Path, tmp_path: Path) -> None:
    assert pages_with_figures(tmp_path) == [page]
    assert list(names_in(page))[1:] == [
        ("walk", "slow, published", "speed"),
        ("walk", "slow, published", "5 deg far"),
    ]
    stored = stored_in(tmp_path)
    assert filled(page, stored) == TEXT.replace("\nIt is fast.\n", NEW)
    assert not missing(page, stored)


@pytest.mark.parametrize(
    ("was", "name"),
    [("walk: slow, p", "run: slow, p"), ("published: speed", "extended: speed"), ("5 deg", "9")],
)
def test_text_without_a_figure_stays_and_is_reported(
    page: Path, tmp_path: Path, was: str, name: str
) -> None:
    text = TEXT.replace(was, name)
    page.write_text(text, "utf-8")
    assert filled(page, stored_in(tmp_path)) == text
    assert all(name.split(":")[0] in one for one in missing(page, stored_in(tmp_path)))
    assert missing(page, stored_in(tmp_path))


@pytest.mark.parametrize("page", PAGES, ids=[path.stem for path in PAGES])
def test_pages_show_the_stored_figures(page: Path) -> None:
    stored = stored_in(DOCS)
    assert not missing(page, stored)
    assert filled(page, stored) == page.read_text("utf-8")


@pytest.mark.parametrize("device", BUILT_IN)
def test_pages_show_every_trial(device: str) -> None:
    """A trial that no page shows would be measured for nothing."""
    shown = {name for page in PAGES for file, name, _ in names_in(page) if file == device}
    unseen = {job.key for job in all_jobs(device) if not rows_of(job)} - shown
    assert not unseen

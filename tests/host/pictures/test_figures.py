from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cubestack.host.pictures.figures import (
    effects,
    error_curves,
    png,
    rate_curves,
    save_curves,
    sky_map,
)
from cubestack.host.pictures.images import save_sample

figure_module = pytest.importorskip("matplotlib.figure")


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Saved figures, before they are rendered."""
    seen = list[Any]()
    monkeypatch.setattr(figure_module.Figure, "savefig", lambda one, *_args, **_: seen.append(one))
    return seen


def panel_of(figures: list[Any]) -> Any:
    (figure,) = figures
    return figure.axes[0]


def legend_of(panel: Any) -> list[str]:
    legend = panel.get_legend() or panel.figure.legends[0]
    return [text.get_text() for text in legend.get_texts()]


def bars_of(container: Any) -> list[list[float]]:
    (collection,) = container.lines[2]
    return [sorted(segment[:, 1]) for segment in collection.get_segments()]


def look(line: Any) -> tuple[object, ...]:
    return line.get_linestyle(), line.get_marker(), line.get_linewidth()


RATES = {
    "right": [(0.5, 0.4, 0.7), (0.9, 0.8, 0.95)],
    "refused": [(0.3, 0.2, 0.4), (0.1, 0.05, 0.2)],
    "wrong": [(0.2, 0.1, 0.3), (0.0, 0.0, 0.1)],
    "failed": [(0.0, 0.0, 0.05), (0.0, 0.0, 0.05)],
}


@pytest.mark.parametrize("places", [[3, 90.5], ["few", "many"], [1, "many"]])
def test_rate_curves_have_error_bars(places: Sequence[Any], figures: list[Any]) -> None:
    rate_curves("false_stars", places, RATES)
    panel = panel_of(figures)
    assert legend_of(panel) == list(RATES)
    for container, values in zip(panel.containers, RATES.values(), strict=True):
        x, y = container.lines[0].get_data()
        assert list(x) == (places if isinstance(places[-1], float) else [0, 1])
        assert list(y) == pytest.approx([100 * rate for rate, *_ in values])
        for bar, (_, low, high) in zip(bars_of(container), values, strict=True):
            assert bar == pytest.approx([100 * low, 100 * high])
    lines = [container.lines[0] for container in panel.containers]
    assert len({look(line) for line in lines}) == len({line.get_color() for line in lines}) == 4
    if places != [3, 90.5]:
        assert list(panel.get_xticks()) == [0, 1]
        assert [text.get_text() for text in panel.get_xticklabels()] == [str(p) for p in places]
    assert panel.get_xlabel() == "false_stars"
    assert "%" in panel.get_ylabel()
    low, high = panel.get_ylim()
    assert -10 < low < 0 < 100 < high < 110


def test_error_curves_are_distributions_with_confidence_bands(figures: list[Any]) -> None:
    sizes = {f"point {n}": [0.5 * n + 0.01 * k for k in range(50 + n)] for n in range(6)}
    error_curves("error_cross_deg", sizes, [(0.02, "published"), (0.3, "other")])
    panel = panel_of(figures)
    curves = panel.lines[:6]
    for number, (line, values) in enumerate(zip(curves, sizes.values(), strict=True)):
        x, y = line.get_data()
        assert list(x) == pytest.approx([max(value, 1e-6) for value in values])
        assert list(y) == pytest.approx([100 * (k + 1) / len(values) for k in range(len(values))])
        points = panel.collections[number].get_paths()[0].vertices
        half = 100 * np.sqrt(np.log(40) / (2 * len(values)))
        for size, share in zip(x, y, strict=True):
            ends = points[np.isclose(points[:, 0], size), 1]
            assert np.isclose(ends, min(share + half, 100)).any()
            assert np.isclose(ends, max(share - half, 0)).any()
        assert points[:, 1].min() == 0
        assert points[:, 1].max() == 100
    assert len({look(line) for line in curves}) == 6
    named = [f"point {n} ({50 + n})" for n in range(6)]
    assert legend_of(panel) == [*named, "published", "other"]
    marks = panel.lines[6:]
    assert [line.get_xdata()[0] for line in marks] == [0.02, 0.3]
    assert len({look(line) for line in marks}) == 2
    assert [line.get_label() for line in marks] == ["published", "other"]
    assert panel.get_xlabel() == "error cross, deg"
    assert panel.get_xscale() == "log"


@pytest.mark.parametrize("name", ["point {}", "false stars = {}, hazard = ['moon', 'planets']"])
def test_long_legend_hides_no_curve_and_is_whole(
    name: str, figures: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    error_curves("error_deg", {name.format(n): [0.1, 0.2, 0.4] for n in range(12)}, [(0.2, "mean")])
    panel = panel_of(figures)
    monkeypatch.undo()
    panel.figure.savefig(BytesIO())
    (legend,) = panel.figure.legends
    box, whole = legend.get_window_extent(), panel.figure.bbox
    assert whole.x0 <= box.x0 < box.x1 <= whole.x1
    assert whole.y0 <= box.y0 < box.y1 <= panel.get_tightbbox().y0


def test_long_names_below_an_axis_are_turned(figures: list[Any]) -> None:
    few = {kind: [(0.5, 0.4, 0.6)] * 3 for kind in ("right", "wrong")}
    for names in (["a", "b", "c"], [["a hazard with a long name", n] for n in range(3)]):
        figures.clear()
        rate_curves("hazard", names, few)
        turned = {text.get_rotation() for text in panel_of(figures).get_xticklabels()}
        assert turned == ({0.0} if names[0] == "a" else {30.0})


PLACES = [
    *((10.0, 1.0, "right"), (10.0, 1.0, "right"), (10.0, 2.0, "wrong")),
    *((200.0, -80.0, "refused"), (200.0, -80.0, "wrong"), (200.0, -80.0, "right")),
    *((360.0, 90.0, "right"), (0.0, -90.0, "wrong"), (359.9, 89.9, "right")),
]


def test_sky_map_counts_results_per_cell(figures: list[Any]) -> None:
    asked = list[tuple[int, int]]()

    def limits(count: int, of: int) -> tuple[float, float]:
        asked.append((count, of))
        return count / of / 2, 1.0

    sky_map(PLACES, limits)
    panel = panel_of(figures)
    (image,) = panel.images
    left, right, bottom, top = image.get_extent()
    rates, of = image.get_array(), {text.get_position(): text for text in panel.texts}
    rows, columns = rates.shape
    for ra_deg, dec_deg, _ in PLACES:
        places = [place for place in PLACES if np.hypot(place[0] - ra_deg, place[1] - dec_deg) < 2]
        share = sum(outcome == "right" for *_, outcome in places) / len(places)
        x = min((ra_deg - left) / (right - left) * columns, columns - 1)
        y = min((np.sin(np.radians(dec_deg)) - bottom) / (top - bottom) * rows, rows - 1)
        assert rates[int(y), int(x)] == pytest.approx(100 * share)
        middle = (int(x) + 0.5) * 360 / columns, (int(y) + 0.5) * 2 / rows - 1
        (text,) = (one for at, one in of.items() if at == pytest.approx(middle))
        assert text.get_text() == f"{len(places)}\n{50 * share:.0f}-100"
        assert text.get_color() == ("white" if share < 0.5 else "black")  # readable
    assert sorted(asked) == [(0, 1), (1, 3), (2, 2), (2, 3)]
    assert np.ma.count(rates) == 4
    assert sum(text.get_text() != "" for text in panel.texts) == 4
    for tick, label in zip(panel.get_yticks(), panel.get_yticklabels(), strict=True):
        assert tick == pytest.approx(np.sin(np.radians(float(label.get_text()))))
    assert {panel.get_yticks()[0], panel.get_yticks()[-1]} == {-1, 1}
    assert list(panel.get_xticks()) == [0, 60, 120, 180, 240, 300, 360]
    assert image.get_clim() == (0, 100)
    wide, high = figures[0].get_size_inches()
    assert wide / high == pytest.approx(360 / 180, rel=0.05)
    figures.clear()
    sky_map([(10, 0, "right"), (10, 0, "wrong")], limits)
    (text,) = (one for one in panel_of(figures).texts if one.get_text())
    assert text.get_color() == "black"


def test_stacked_effects_add_up_to_each_bar(figures: list[Any]) -> None:
    counts = {f"effect {n}": [n + 1, 0 if n else 19] for n in range(8)} | {"never": [0, 0]}
    parts = [("writer", 36), ("bank", 19)]
    effects(parts, counts, [(0.1, 0.3), (0.0, 0.2)], "upsets")
    panel = panel_of(figures)
    bars = [one for one in panel.containers if hasattr(one, "patches")]
    names = [f"effect {n} ({n + 1 + (0 if n else 19)})" for n in range(8)]
    assert [one.get_label() for one in bars] == names
    assert sorted(legend_of(panel)) == sorted([*names, "seen to the right, 95 %"])
    for part, (_, of) in enumerate(parts):
        end = 0.0
        for bar, values in zip(bars, counts.values(), strict=False):
            patch = bar.patches[part]
            assert patch.get_x() == pytest.approx(end)
            assert patch.get_width() == pytest.approx(100 * values[part] / of)
            assert patch.get_y() < part < patch.get_y() + patch.get_height()
            end += patch.get_width()
        assert end == pytest.approx(100)
    looks = [(one.patches[0].get_facecolor(), one.patches[0].get_hatch()) for one in bars]
    assert len({colour for colour, _ in looks}) == len(looks)
    (seen,) = (one for one in panel.containers if one not in bars)
    (collection,) = seen.lines[2]
    ends = [sorted(segment[:, 0]) for segment in collection.get_segments()]
    assert ends == [pytest.approx([70, 90]), pytest.approx([80, 100])]
    assert [text.get_text() for text in panel.get_yticklabels()] == ["writer (36)", "bank (19)"]
    assert panel.yaxis_inverted()  # the first one is on top
    assert panel.get_xlim() == (0, 100)
    assert panel.get_xlabel() == "% of upsets"
    assert figures[0].get_figheight() > 1 + 0.15 * len(parts)


@pytest.mark.parametrize("shown", range(1, 9))
def test_effects_are_shaded_from_white_to_black(shown: int, figures: list[Any]) -> None:
    effects([("a", shown)], {str(n): [1] for n in range(shown)}, [(0, 1)], "upsets")
    bars = [one for one in panel_of(figures).containers if hasattr(one, "patches")]
    greys = [one.patches[0].get_facecolor()[0] for one in bars]
    assert greys == sorted(set(greys), reverse=True)
    assert greys[0] == 1.0
    assert len(greys) == 1 or greys[-1] == 0.0


def counts(strength: float, right: int, refused: int, wrong: int) -> Any:
    outcomes = {"right": right, "refused": refused, "wrong": wrong}
    return SimpleNamespace(strength=strength, pictures=sum(outcomes.values()), **outcomes)


CURVES = {
    "CubeStar": [counts(0, 20, 0, 0), counts(7.5, 5, 10, 5)],
    "AraMiS": [counts(0, 9, 0, 1), counts(7.5, 0, 9, 1)],
}


def test_each_device_has_a_panel_with_three_curves(figures: list[Any]) -> None:
    def limits(count: int, of: int) -> tuple[float, float]:
        return count / of / 2, (1 + count / of) / 2

    save_curves(CURVES, "phase, deg", "A moon", limits, Path("none.png"))
    (figure,) = figures
    assert [panel.get_title() for panel in figure.axes] == list(CURVES)
    for panel, points in zip(figure.axes, CURVES.values(), strict=True):
        assert len(panel.lines) == 3
        bands = dict(zip(("right", "wrong"), panel.collections, strict=True))
        for line in panel.lines:
            kind = line.get_label()
            shares = [getattr(point, kind) / point.pictures for point in points]
            assert list(line.get_ydata()) == pytest.approx([100 * share for share in shares])
            if kind in bands:
                vertices = bands[kind].get_paths()[0].vertices
                for place, share in enumerate(shares):
                    column = vertices[np.isclose(vertices[:, 0], place), 1]
                    assert column.min() == pytest.approx(50 * share)
                    assert column.max() == pytest.approx(50 + 50 * share)
        assert len({line.get_marker() for line in panel.lines}) == 3
        assert list(panel.get_xticks()) == [0, 1]
        assert [text.get_text() for text in panel.get_xticklabels()] == ["0", "7.5"]
        assert panel.get_xlabel() == "phase, deg"
        low, high = panel.get_ylim()
        assert -10 < low < 0 < 100 < high < 110
    assert "%" in figure.axes[0].get_ylabel()
    assert legend_of(figure.axes[0]) == ["right", "refused", "wrong"]
    assert figure.get_suptitle() == "A moon"
    wide = figure.get_figwidth()
    save_curves(CURVES | {"third": CURVES["AraMiS"]}, "x", "y", limits, Path("none.png"))
    assert figures[1].get_figwidth() == pytest.approx(1.5 * wide)


def test_figures_are_png_files(tmp_path: Path) -> None:
    save_curves(CURVES, "phase", "A moon", lambda count, of: (0, 1), tmp_path / "curves.png")
    figure = figure_module.Figure(figsize=(6, 3.4))
    with Image.open(BytesIO(png(figure))) as image, Image.open(tmp_path / "curves.png") as curves:
        assert image.format == curves.format == "PNG"
        assert image.width / 6 == pytest.approx(image.height / 3.4, rel=0.01)
        assert 80 < image.width / 6 < 200  # dots per inch


def test_sample_keeps_its_shape_and_brightness() -> None:
    picture = np.full((200, 300), 20, np.uint8)
    picture[50:80, 30:60] = 200
    file = BytesIO()
    save_sample(picture, file)
    with Image.open(file) as image:
        grey = np.asarray(image.convert("L")).astype(float)
        assert image.format == "JPEG"
    rows, columns = grey.shape
    assert rows / columns == pytest.approx(2 / 3, abs=0.01)
    assert 300 < columns < 800
    y, x = np.nonzero(grey > 128)
    assert (x.mean() / columns, y.mean() / rows) == pytest.approx((45 / 300, 65 / 200), abs=0.01)
    assert grey[y.min() + 8, x.min() + 8] > 240
    assert np.median(grey) < 8

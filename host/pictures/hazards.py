"""Figures of hazards: curves of right and wrong against strength, and a picture of each."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO, Protocol

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from cubestack.host.errors import install_command
from cubestack.host.pictures.images import stretched

WIDTH_PX = 480
RIGHT, REFUSED, WRONG = "#1a7f37", "#9a9a9a", "#c62828"


class Limits(Protocol):
    """Gives the limits of a rate."""

    def __call__(self, count: int, of: int) -> tuple[float, float]: ...


def save_sample(picture: NDArray[np.uint8], path: Path | BinaryIO) -> None:
    """Write grey values (rows, columns) as a small JPEG that is stretched for the eye.

    As ``stretched`` does it.
    """
    image = Image.fromarray(stretched(picture))
    height = round(WIDTH_PX * picture.shape[0] / picture.shape[1])
    image.resize((WIDTH_PX, height), Image.Resampling.LANCZOS).save(
        path, "JPEG", quality=70, optimize=True
    )


def save_curves(
    rows: Mapping[str, Sequence[Any]], axis: str, title: str, limits: Limits, path: Path
) -> None:
    """Write shares of right, refused and wrong frames against strength, a panel for each device.

    Args:
        rows: points by the device's name; each with strength, pictures, right, refused, wrong.
        axis: what strength is, with its unit.
        title: of the whole.
        limits: of a rate; the bands of right and wrong.
        path: of the PNG.

    Raises:
        ValueError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise ValueError(f"figures need matplotlib: {install_command('plots')}") from None
    figure = Figure(figsize=(3.2 * max(len(rows), 1.6), 2.9), layout="constrained")
    panels = figure.subplots(1, len(rows), sharey=True, squeeze=False)[0]
    for panel, (name, points) in zip(panels, rows.items(), strict=True):
        places = range(len(points))
        for kind, colour, marker in (
            ("right", RIGHT, "o"),
            ("refused", REFUSED, "s"),
            ("wrong", WRONG, "x"),
        ):
            shares = [100 * getattr(point, kind) / point.pictures for point in points]
            panel.plot(places, shares, marker=marker, color=colour, label=kind, linewidth=1.5)
            if kind != "refused":
                bands = [limits(getattr(point, kind), point.pictures) for point in points]
                low, high = np.array(bands).T * 100
                panel.fill_between(places, low, high, color=colour, alpha=0.15, linewidth=0)
        panel.set_xticks(places, [f"{point.strength:g}" for point in points])
        panel.set(title=name, xlabel=axis, ylim=(-4, 104))
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("% of pictures")
    panels[0].legend(loc="center left", fontsize="small")
    figure.suptitle(title, fontsize="medium")
    figure.savefig(path, dpi=110)

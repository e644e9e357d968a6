"""A picture to be read: marks and labels over it, below it what they mean and how large it is.

Over the picture are rings of equal angle from the boresight, the marks, and their labels, which
never overlap. Below are a title, what was found and left out, a legend and a bar of degrees.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from cubestack.host.pictures.files import DEMO, save_png
from cubestack.host.pictures.labels import Box, Wanted, place

Colour = tuple[int, int, int]
Pixels = NDArray[np.float64]
Lens = Callable[[Pixels], Pixels]
"""Columns and rows (n, 2) of directions (n, 3) in camera axes: x right, y down, z out."""

Shape = Literal["circle", "cross", "ticks", "square", "line"]

PAPER: Colour = (22, 24, 30)
TEXT: Colour = (228, 230, 235)
GRID: Colour = (105, 135, 190)
TRUTH: Colour = (255, 225, 70)
PLATE: Colour = (12, 13, 16)
"""Behind names and angles, as pictures may be bright there."""

PAD_PX = 2.0
"""Of a plate, at each side of the text."""

EM = 1 / 62
"""Height of the text, in widths of the picture."""

STEPS_DEG = (1.0, 2.0, 5.0, 10.0, 20.0)
RINGS = 4
"""Rings of the grid that reach to the corner, at most."""

RING_POINTS = 180
BAR = 0.18
"""Length of the bar of degrees, in widths of the picture, at most."""


@dataclass(frozen=True)
class Entry:
    """A line of the legend; drawn when something of the kind is in the picture."""

    shape: Shape
    colour: Colour
    text: str


class Sheet:
    """One picture that is being drawn; places are those of its pixels, (0, 0) the first's centre.

    Attributes:
        image: the picture so far, without what is below.
        em: height of the text, px.
        blocked: what labels keep off, px of ``image``.
    """

    def __init__(self, picture: NDArray[np.uint8], scale: int = 1) -> None:
        """Begin with grey values (rows, columns), each ``scale`` x ``scale`` pixels large."""
        rows, columns = picture.shape
        size = scale * columns, scale * rows
        self.image = Image.fromarray(picture).resize(size, Image.Resampling.BOX).convert("RGB")
        self.em = max(11, round(EM * size[0]))
        self.blocked: list[Box] = []
        self._scale = scale
        self._draw = ImageDraw.Draw(self.image)
        self._font = ImageFont.load_default(self.em)
        self._line = max(1, round(self.em / 12))
        self._labels: list[tuple[Wanted, str, Colour]] = []
        self._grid: list[tuple[Wanted, str, Colour]] = []
        self._bar: tuple[float, float] | None = None

    def grid(self, lens: Lens, widest_deg: float) -> None:
        """Draw rings of equal angle from the boresight, and the bar of degrees.

        ``widest_deg`` is the angle of what is farthest from it, less than 180.
        """
        fitting = (step for step in STEPS_DEG if widest_deg / step <= RINGS)
        step = next(fitting, STEPS_DEG[-1])
        around = np.linspace(0, 2 * np.pi, RING_POINTS + 1)
        circle = np.stack([np.cos(around), np.sin(around)], axis=1)
        for angle in np.arange(step, widest_deg, step):
            across = np.sin(np.radians(angle))
            along = np.full((len(circle), 1), np.cos(np.radians(angle)))
            rim = self._at(lens(np.hstack([across * circle, along])))
            for first, second in zip(rim[::2], rim[1::2], strict=False):
                if np.isfinite(first).all() and np.isfinite(second).all():
                    self._draw.line((*first, *second), fill=GRID, width=self._line)
            where = rim[RING_POINTS // 8], rim[0], rim[RING_POINTS // 4], rim[RING_POINTS // 2]
            seen = [one for one in where if self._within(one)]
            if seen:
                self._wish(self._grid, seen[0], 0, f"{angle:g}°", GRID)
        self._cross(self._at(lens(np.array([[0.0, 0.0, 1.0]])))[0], 0.5 * self.em, GRID)
        self._set_bar(lens)

    def mark(
        self, shape: Shape, place_px: Pixels, colour: Colour, size: float = 0.6, name: str = ""
    ) -> None:
        """Draw a mark of radius ``size``, in heights of the text, and request its label."""
        at, radius = self._at(place_px), size * self.em
        if not self._within(at):
            return
        self._shape(self._draw, shape, at, radius, PLATE, self._line + 2)
        self._shape(self._draw, shape, at, radius, colour)
        x, y = at
        if shape == "ticks":
            thin = self._line
            self.blocked.append(Box(x - radius, y - thin, x + radius, y + thin))
            self.blocked.append(Box(x - thin, y - radius, x + thin, y + radius))
        else:
            self.blocked.append(Box(x - radius, y - radius, x + radius, y + radius))
        if name:
            self._wish(self._labels, at, radius, name, colour)

    def outline(self, points: Pixels, colour: Colour) -> None:
        """Draw a closed line through ``points`` (n, 2)."""
        at = [tuple(point) for point in self._at(points)]
        self._draw.line([*at, at[0]], fill=colour, width=self._line)

    def save(self, path: Path, title: str, told: str, legend: Sequence[Entry]) -> None:
        """Write it as a PNG with labels, with ``title``, the text ``told``, and a legend below."""
        save_png(self.finished(title, told, legend), path, DEMO)

    def finished(self, title: str, told: str, legend: Sequence[Entry]) -> Image.Image:
        """The whole, as ``save`` writes it."""
        missing = self._write_labels()
        if missing:
            told += f"; names without room: {missing}"
        lines = [*_wrapped(title, self._columns), *_wrapped(told, self._columns)]
        rows = self._rows(legend)
        height = round(self.em * (1.4 * len(lines) + 1.7 * len(rows) + 1.0))
        sheet = Image.new("RGB", (self.image.width, self.image.height + height), PAPER)
        sheet.paste(self.image, (0, 0))
        draw = ImageDraw.Draw(sheet)
        top = self.image.height + 0.5 * self.em
        for line in lines:
            draw.text((self.em, top), line, fill=TEXT, font=self._font)
            top += 1.4 * self.em
        top += 0.3 * self.em
        for row in rows:
            for left, entry in row:
                middle = np.array([left, top + 0.65 * self.em])
                self._shape(draw, entry.shape, middle, 0.5 * self.em, entry.colour)
                draw.text((left + self.em, top), entry.text, fill=TEXT, font=self._font)
            top += 1.7 * self.em
        self._draw_bar(draw, top - 1.7 * self.em)
        return sheet

    # --- over the picture -------------------------------------------------------------------------

    def _at(self, places_px: Pixels) -> Pixels:
        return self._scale * (np.asarray(places_px, np.float64) + 0.5)

    def _within(self, at: Pixels) -> bool:
        return bool(0 <= at[0] <= self.image.width and 0 <= at[1] <= self.image.height)

    def _wish(
        self,
        labels: list[tuple[Wanted, str, Colour]],
        at: Pixels,
        radius: float,
        text: str,
        colour: Colour,
    ) -> None:
        width = self._font.getlength(text) + 2 * PAD_PX
        labels.append((Wanted(at[0], at[1], radius, width, 1.2 * self.em), text, colour))

    def _write_labels(self) -> int:
        """Write names, then angles where there is room; returns how many names had none."""
        labels = [*self._labels, *self._grid]
        frame = Box(0, 0, self.image.width, self.image.height)
        boxes = place([wanted for wanted, _, _ in labels], frame, self.blocked)
        for box, (_, text, colour) in zip(boxes, labels, strict=True):
            if box is not None:
                self._draw.rectangle((box.left, box.top, box.right, box.bottom), fill=PLATE)
                at = box.left + PAD_PX, box.top
                self._draw.text(at, text, colour, self._font)
        return boxes[: len(self._labels)].count(None)

    def _cross(self, at: Pixels, arm: float, colour: Colour) -> None:
        self._shape(self._draw, "cross", at, arm, colour)

    def _shape(
        self,
        draw: ImageDraw.ImageDraw,
        shape: Shape,
        at: Pixels,
        radius: float,
        colour: Colour,
        wide: int = 0,
    ) -> None:
        x, y = at
        box, wide = (x - radius, y - radius, x + radius, y + radius), wide or self._line
        if shape == "circle":
            draw.ellipse(box, outline=colour, width=wide)
        elif shape == "square":
            draw.rectangle(box, outline=colour, width=wide)
        elif shape == "line":
            draw.line((x - radius, y, x + radius, y), fill=colour, width=wide)
        elif shape == "cross":
            draw.line((x - radius, y, x + radius, y), fill=colour, width=wide)
            draw.line((x, y - radius, x, y + radius), fill=colour, width=wide)
        else:
            for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                near = 0.6 * radius
                ends = (x + near * dx, y + near * dy, x + radius * dx, y + radius * dy)
                draw.line(ends, fill=colour, width=wide)

    # --- below it ---------------------------------------------------------------------------------

    @property
    def _columns(self) -> Callable[[str], bool]:
        return lambda text: self._font.getlength(text) <= self.image.width - 2 * self.em

    def _set_bar(self, lens: Lens) -> None:
        ahead = self._at(lens(np.array([[0.0, 0.0, 1.0]])))[0]
        for step in STEPS_DEG:
            aside = np.array([[np.sin(np.radians(step)), 0.0, np.cos(np.radians(step))]])
            length = float(np.linalg.norm(self._at(lens(aside))[0] - ahead))
            if self._bar is None or length <= BAR * self.image.width:
                self._bar = step, length

    def _rows(self, legend: Sequence[Entry]) -> list[list[tuple[float, Entry]]]:
        """Entries with their places from the left; the last row has the bar at its right."""
        rows: list[list[tuple[float, Entry]]] = [[]]
        left = 1.5 * self.em
        bar = (0 if self._bar is None else self._bar[1]) + 5 * self.em
        for entry in legend:
            width = self._font.getlength(entry.text) + 2.4 * self.em
            if rows[-1] and left + width > self.image.width - bar:
                rows.append([])
                left = 1.5 * self.em
            rows[-1].append((left, entry))
            left += width
        return rows

    def _draw_bar(self, draw: ImageDraw.ImageDraw, top: float) -> None:
        if self._bar is None:
            return
        degrees, length = self._bar
        right, y = self.image.width - self.em, top + 0.65 * self.em
        text = f"{degrees:g}°"
        width = self._font.getlength(text)
        draw.text((right - width, top), text, fill=TEXT, font=self._font)
        right -= width + 0.5 * self.em
        draw.line((right - length, y, right, y), fill=TEXT, width=2 * self._line)
        for x in (right - length, right):
            draw.line((x, y - 0.35 * self.em, x, y + 0.35 * self.em), fill=TEXT, width=self._line)


def _wrapped(text: str, fits: Callable[[str], bool]) -> list[str]:
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if fits(longer):
            lines[-1] = longer
        else:
            lines.append(word)
    return lines

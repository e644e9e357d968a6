"""CubeSense's pictures for people: edges and limb of the Earth, the Sun and its window.

Drawn from what the node tells: angles, radius, edges, first Sun pixel; the lens by its published
polynomial (CubeSense thesis, equation 5.2.3) and boresights (table 5.1), as declared in the
telecommands.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from cubestack.firmware_model.interface.cubesense import INTERFACE
from cubestack.firmware_model.interface.cubesense.codes import PIXELS_PER_DEGREE, Camera
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE
from cubestack.firmware_model.interface.cubesense.telecommands import DISTORTION
from cubestack.host.clients.cubesense.client import CubeSense, direction
from cubestack.host.pictures.overlay import Mark, Overlay

SCALE = 2
INSET_SCALE = 16
INSET_MARGIN = 4
LIMB_POINTS = 180
EDGE = (255, 90, 90)
FITTED = (120, 255, 120)
AXIS = (120, 170, 255)

Pixels = NDArray[np.float64]


def pixel(camera: Camera, vectors: Pixels) -> Pixels:
    """Columns and rows (n, 2) at which ``camera`` sees directions (n, 3) in its axes."""
    values = INTERFACE.telecommand(f"Boresight{camera + 1}").reset_values()
    boresight = np.array([float(values[axis]) for axis in "XY"])
    across = np.linalg.norm(vectors[:, :2], axis=1)
    undistorted = PIXELS_PER_DEGREE * np.degrees(np.arctan2(across, vectors[:, 2]))
    radius = np.polynomial.polynomial.polyval(undistorted, DISTORTION)
    unit = vectors[:, :2] / np.where(across > 0, across, 1)[:, None]
    found: Pixels = boresight + radius[:, None] * unit
    return found


def limb(alpha_deg: float, beta_deg: float, radius_deg: float) -> Pixels:
    """Columns and rows (n, 2) of a cone's rim in the nadir picture: axis, angular radius."""
    axis = direction(alpha_deg, beta_deg)
    side = np.cross(axis, (0.0, 1.0, 0.0) if abs(axis[0]) > abs(axis[1]) else (1.0, 0.0, 0.0))
    side /= np.linalg.norm(side)
    around = np.linspace(0, 2 * np.pi, LIMB_POINTS, endpoint=False)
    circle = np.outer(np.cos(around), side) + np.outer(np.sin(around), np.cross(axis, side))
    rho = np.radians(radius_deg)
    return pixel(Camera.NADIR, np.cos(rho) * axis + np.sin(rho) * circle)


def overlay(cubesense: CubeSense, picture: str) -> Overlay:
    """What was found in the memory called ``picture``: edges and limb, or the Sun and its window.

    Nothing where no camera's latest picture lies. Raises the client's errors.
    """
    marks, lines = list[Mark](), list[Pixels]()
    for camera in Camera:
        measured, details = cubesense.result(camera), cubesense.details(camera)
        if not picture.endswith(f" {Camera(int(details['Sram'])).name.lower()}"):
            continue
        angles = (measured.alpha_deg, measured.beta_deg)
        if camera is Camera.NADIR and measured.capture.stored:
            marks += [Mark(x, y, "edge") for x, y in cubesense.edges().tolist()]
            if measured.detected:
                lines.append(limb(*angles, float(details["Radius"]) / PIXELS_PER_DEGREE))
        elif measured.detected:
            x, y = pixel(camera, direction(*angles)[None])[0].tolist()
            marks.append(Mark(x, y, "Sun"))
            first = int(details["FirstX"]), int(details["FirstY"])
            left, top = FULL_SIZE.window_origin(*first)
            right, bottom = left + FULL_SIZE.window, top + FULL_SIZE.window
            corners = ((left, top), (right, top), (right, bottom), (left, bottom))
            lines.append(np.array(corners, np.float64))
    return Overlay(marks, lines)


def annotate_nadir(
    picture: NDArray[np.uint8], edges: Pixels, fitted: tuple[float, float, float] | None, path: Path
) -> None:
    """Write the nadir ``picture`` (480, 640) with its ``edges`` (n, 2) and the ``fitted`` Earth.

    ``fitted`` is alpha, beta and angular radius in degrees, None when there is no fit.
    """
    image, draw = _canvas(picture)
    _cross(draw, pixel(Camera.NADIR, np.array([[0.0, 0.0, 1.0]]))[0], 6, AXIS)
    if fitted is not None:
        rim = [tuple(SCALE * (point + 0.5)) for point in limb(*fitted)]
        draw.line([*rim, rim[0]], fill=FITTED, width=1)
        centre = pixel(Camera.NADIR, direction(*fitted[:2])[None])[0]
        _cross(draw, centre, 10, FITTED)
    for edge in edges:
        x, y = SCALE * (edge + 0.5)
        draw.ellipse((x - 4, y - 4, x + 4, y + 4), outline=EDGE, width=2)
    image.save(path)


def annotate_sun(
    picture: NDArray[np.uint8],
    first: tuple[int, int],
    angles: tuple[float, float] | None,
    path: Path,
) -> None:
    """Write the sun ``picture`` (480, 640) with the window at its ``first`` Sun pixel.

    ``angles`` are alpha and beta in degrees, None when the Sun was not found. The window is shown
    once more, enlarged, in the corner of the picture that is farthest from it.
    """
    image, draw = _canvas(picture)
    _cross(draw, pixel(Camera.SUN, np.array([[0.0, 0.0, 1.0]]))[0], 6, AXIS)
    if angles is not None:
        centre = pixel(Camera.SUN, direction(*angles)[None])[0]
        left, top = FULL_SIZE.window_origin(*first)
        side = FULL_SIZE.window
        draw.rectangle(
            (SCALE * left, SCALE * top, SCALE * (left + side), SCALE * (top + side)), outline=EDGE
        )
        _cross(draw, centre, 12, FITTED)
        _inset(image, picture, (left, top), centre)
    image.save(path)


def _canvas(picture: NDArray[np.uint8]) -> tuple[Image.Image, ImageDraw.ImageDraw]:
    rows, columns = picture.shape
    image = Image.fromarray(picture).resize((SCALE * columns, SCALE * rows), Image.Resampling.BOX)
    image = image.convert("RGB")
    return image, ImageDraw.Draw(image)


def _cross(draw: ImageDraw.ImageDraw, at: Pixels, arm: float, colour: tuple[int, int, int]) -> None:
    x, y = SCALE * (at + 0.5)
    draw.line((x - arm, y, x + arm, y), fill=colour)
    draw.line((x, y - arm, x, y + arm), fill=colour)


def _inset(
    image: Image.Image, picture: NDArray[np.uint8], origin: tuple[int, int], centre: Pixels
) -> None:
    """Put the window, enlarged, where it hides nothing of interest."""
    rows, columns = picture.shape
    side = FULL_SIZE.window + 2 * INSET_MARGIN
    left = min(max(origin[0] - INSET_MARGIN, 0), columns - side)
    top = min(max(origin[1] - INSET_MARGIN, 0), rows - side)
    size = side * INSET_SCALE
    part = Image.fromarray(picture[top : top + side, left : left + side])
    part = part.resize((size, size), Image.Resampling.BOX).convert("RGB")
    draw = ImageDraw.Draw(part)
    x, y = (INSET_SCALE * (origin[0] - left), INSET_SCALE * (origin[1] - top))
    width = INSET_SCALE * FULL_SIZE.window
    draw.rectangle((x, y, x + width, y + width), outline=EDGE)
    x, y = INSET_SCALE * (centre + 0.5 - (left, top))
    draw.line((x - 12, y, x + 12, y), fill=FITTED, width=2)
    draw.line((x, y - 12, x, y + 12), fill=FITTED, width=2)
    draw.rectangle((0, 0, size - 1, size - 1), outline=AXIS)
    image.paste(
        part,
        (
            0 if origin[0] > columns / 2 else image.width - size,
            0 if origin[1] > rows / 2 else image.height - size,
        ),
    )

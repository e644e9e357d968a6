"""CubeSense's overlays: edges and limb of the Earth, the Sun and its window.

They use the node's telemetry (angles, radius, edges, first Sun pixel) and the lens' published
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
from cubestack.host.pictures.images import stretched
from cubestack.host.pictures.labels import Box
from cubestack.host.pictures.overlay import Mark, Overlay
from cubestack.host.pictures.sheet import GRID, TRUTH, Entry, Sheet

SCALE = 2
INSET_SCALE = 16
INSET_MARGIN = 4
LIMB_POINTS = 180
EDGE = (255, 90, 90)
FITTED = (120, 255, 120)
WIDEST_DEG = 90.0
"""Extent of the grid in deg: half of the lens' field."""

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
    """Overlay of the memory called ``picture``: edges and limb, or the Sun and its window.

    Empty if it holds no camera's latest image. Raises the client's errors.
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
                x, y = pixel(camera, direction(*angles)[None])[0].tolist()
                marks.append(Mark(x, y, "nadir"))
            if measured.detected and details["Radius"]:  # not every profile calculates it
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
    picture: NDArray[np.uint8],
    edges: Pixels,
    fitted: tuple[float, float, float] | None,
    path: Path,
    title: str = "nadir camera",
    truth: tuple[float, float] | None = None,
) -> None:
    """Write the nadir ``picture`` (480, 640) with its ``edges`` (n, 2) and the ``fitted`` Earth.

    ``fitted`` is alpha, beta and angular radius in degrees, or None; the radius is 0 if the program
    reports none. ``truth`` is alpha and beta of the Earth's true centre, if known.
    """
    sheet = _sheet(picture, Camera.NADIR)
    legend = [Entry("circle", EDGE, "edge found on a scanned line")]
    told = f"{len(edges)} edges found"
    for edge in edges:
        sheet.mark("circle", edge, EDGE, 0.35)
    if fitted is None:
        told += "; no Earth found"
    else:
        sheet.mark("cross", _seen(Camera.NADIR, fitted[:2]), FITTED, 0.7)
        legend.append(Entry("cross", FITTED, "centre found"))
        told += f"; centre at {_angles(fitted[:2])}"
        if fitted[2] > 0:
            sheet.outline(limb(*fitted), FITTED)
            legend.append(Entry("line", FITTED, "limb fitted"))
            told += f", radius {fitted[2]:.2f}°"
        else:
            told += " (this program reports no radius)"
    told += _true(sheet, legend, Camera.NADIR, truth)
    legend.append(Entry("cross", GRID, "boresight, angles from it"))
    sheet.save(path, title, told, legend)


def annotate_sun(
    picture: NDArray[np.uint8],
    first: tuple[int, int],
    angles: tuple[float, float] | None,
    path: Path,
    title: str = "sun camera",
    truth: tuple[float, float] | None = None,
) -> None:
    """Write the sun ``picture`` (480, 640) with the window at its ``first`` Sun pixel.

    ``angles`` are alpha and beta in degrees, None without detection; ``truth`` the true ones, if
    known. The corner farthest from the window shows it enlarged.
    """
    sheet = _sheet(picture, Camera.SUN)
    legend: list[Entry] = []
    told = "no Sun found" if angles is None else f"Sun at {_angles(angles)}"
    if angles is not None:
        side = FULL_SIZE.window
        origin = FULL_SIZE.window_origin(*first)
        corners = np.array([[0, 0], [side, 0], [side, side], [0, side]]) + origin - 0.5
        sheet.outline(corners, EDGE)
        sheet.mark("cross", _seen(Camera.SUN, angles), FITTED, 0.7)
        legend.append(Entry("square", EDGE, "window that is read, enlarged in the corner"))
        legend.append(Entry("cross", FITTED, "centroid found"))
    told += _true(sheet, legend, Camera.SUN, truth)
    legend.append(Entry("cross", GRID, "boresight, angles from it"))
    if angles is not None:
        centre = _seen(Camera.SUN, angles)
        true = None if truth is None else _seen(Camera.SUN, truth)
        sheet.blocked.append(_inset(sheet.image, picture, origin, centre, true))
    sheet.save(path, title, told, legend)


def _sheet(picture: NDArray[np.uint8], camera: Camera) -> Sheet:
    sheet = Sheet(stretched(picture, gamma=1.0), SCALE)
    sheet.grid(lambda vectors: pixel(camera, vectors), WIDEST_DEG)
    return sheet


def _seen(camera: Camera, angles: tuple[float, float]) -> Pixels:
    """Column and row at which a camera sees alpha and beta, deg."""
    place: Pixels = pixel(camera, direction(*angles)[None])[0]
    return place


def _angles(angles: tuple[float, float]) -> str:
    return f"alpha {angles[0]:+.2f}°, beta {angles[1]:+.2f}°"


def _true(
    sheet: Sheet, legend: list[Entry], camera: Camera, truth: tuple[float, float] | None
) -> str:
    """Mark the truth, if known; returns its caption."""
    if truth is None:
        return ""
    sheet.mark("ticks", _seen(camera, truth), TRUTH, 1.4)
    legend.append(Entry("ticks", TRUTH, "truth (unknown to the device)"))
    return f"; truth {_angles(truth)}"


def _inset(
    image: Image.Image,
    picture: NDArray[np.uint8],
    origin: tuple[int, int],
    centre: Pixels,
    truth: Pixels | None,
) -> Box:
    """Draw the enlarged window in a free corner; returns its position."""
    rows, columns = picture.shape
    side = FULL_SIZE.window + 2 * INSET_MARGIN
    left = min(max(origin[0] - INSET_MARGIN, 0), columns - side)
    top = min(max(origin[1] - INSET_MARGIN, 0), rows - side)
    part = Sheet(picture[top : top + side, left : left + side], INSET_SCALE)
    x, y = origin[0] - left - 0.5, origin[1] - top - 0.5
    wide = FULL_SIZE.window
    part.outline(np.array([[x, y], [x + wide, y], [x + wide, y + wide], [x, y + wide]]), EDGE)
    part.mark("cross", centre - (left, top), FITTED, 1.2)
    if truth is not None:
        part.mark("ticks", truth - (left, top), TRUTH, 2.1)
    size = part.image.width
    ImageDraw.Draw(part.image).rectangle((0, 0, size - 1, size - 1), outline=GRID, width=2)
    x = 0 if origin[0] > columns / 2 else image.width - size
    y = 0 if origin[1] > rows / 2 else image.height - size
    image.paste(part.image, (x, y))
    return Box(x, y, x + size, y + size)

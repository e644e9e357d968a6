"""A star tracker as the comparison sees it: what it sees, what it stores, and its processor.

A device offers one as function ``tracker`` of module ``compare`` in its package of studies, which
is its study "campaign"; module ``alternatives`` there has methods of its own program. Methods work
on directions of stars, so no image is rendered; the camera's lens, field and noise decide which
stars there are and where.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from math import atan, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.camera.common.optics import Optics
from cubestack.firmware_model.mcu.costs import CostTable, Meter
from cubestack.firmware_model.star_tracker.observation import View
from cubestack.host.devices.registry import devices

Floats = NDArray[np.float32]
Indices = NDArray[np.intp]

PACKAGE = "campaign"  #: study of a device that is its package of studies
TRACKER, ALTERNATIVES = "compare", "alternatives"  #: modules in it
NONE = -1  #: mark of a star without identity


@dataclass(frozen=True, eq=False)
class Image:
    """Measured stars, the brightest first."""

    pixels: Floats  #: (n, 2) x and y
    rays: Floats  #: (n, 3) unit vectors in camera axes
    brightness: Floats  #: (n,) light, in any linear unit
    attitude: NDArray[np.float64]  #: (3, 3) the truth: inertial to camera


Identify = Callable[[Image, Meter], Indices]
"""Returns the star (n,) in the tracker's list for each measured one, or ``NONE``."""


@dataclass(frozen=True, eq=False)
class Firmware:
    """The identification of the device's own program."""

    identify: Identify
    database_bytes: int  #: of what it reads


@dataclass(frozen=True, eq=False)
class Tracker:
    """A star tracker."""

    name: str  #: of the device
    title: str
    optics: Optics
    view: View  #: what an image shows
    stars: Floats  #: (m, 3) inertial unit vectors of the star list
    v_mag: NDArray[np.float64]  #: (m,) their magnitudes
    faintest_mag: float  #: stars fainter than this V magnitude are not seen
    false_mag: tuple[float, float]  #: magnitudes of false stars: those of the stars that are used
    noise_px: float  #: standard deviation of a centroid, each axis
    margin_rad: float  #: within which an angle between two stars agrees
    pair_limit_rad: float  #: longest angle that is listed
    most: int  #: stars of an image; the faintest others are dropped
    used: int  #: of these, how many a method takes that compares all with all
    #: the processor; its ``flash_read`` is a word of the database, wherever it is stored
    table: CostTable
    room_bytes: int  #: of the memory that holds the database
    firmware: Mapping[str, Firmware]  #: by profile

    @cached_property
    def focal_px(self) -> float:
        return self.optics.focal_length_mm / (self.optics.pixel_pitch_um / 1000)

    @cached_property
    def half_field_rad(self) -> float:
        """Half of the field's shorter side."""
        return atan(min(self.optics.columns, self.optics.rows) / 2 / self.focal_px)

    @cached_property
    def listed_in_field(self) -> float:
        """Stars of the list that an image shows on average."""
        return len(self.stars) * self.view.solid_angle_sr / (4 * pi)


def _modules(name: str) -> dict[str, str]:
    """Modules of this name in the packages of studies, by device."""
    packages = {one.name: one.study(PACKAGE) for one in devices() if PACKAGE in one.studies}
    found = {device: f"{package}.{name}" for device, package in packages.items()}
    return {device: module for device, module in found.items() if find_spec(module)}


def trackers() -> list[str]:
    """Names of the registered devices that have one."""
    return list(_modules(TRACKER))


def tracker(name: str) -> Tracker:
    """A device's tracker; raises ValueError if it has none."""
    known = _modules(TRACKER)
    if name not in known:
        raise ValueError(f"{name} has no star tracker to compare; there are {', '.join(known)}")
    loaded: Tracker = import_module(known[name]).tracker()
    return loaded


def alternatives() -> list[Any]:
    """Modules with methods of the devices' programs: tuples IDENTIFICATION and ATTITUDE."""
    return [import_module(module) for module in _modules(ALTERNATIVES).values()]

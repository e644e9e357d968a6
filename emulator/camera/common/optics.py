"""A lens in front of a sensor: directions to pixels and back, magnitudes to electrons.

CubeStar thesis, section 3.4.4 (equation 3.4.2), section 4.1.4 (Brown's model, equations 4.1.3 to
4.1.5) and section 4.1.5 (equation 4.1.6). Equation 3.4.2 multiplies aperture, transmission,
bandwidth and the flux of the star; an effective width replaces transmission, bandwidth and quantum
efficiency here.
"""

from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cubestack.emulator.camera.common.hazards.contract import Lens
from cubestack.emulator.camera.common.residual import Displacement, displace, restore
from cubestack.emulator.light.distortion import Brown
from cubestack.emulator.scene.file import SceneError
from cubestack.firmware_model.values import (
    REQUIRED,
    DeclaredValues,
    choice,
    number,
    positive,
    whole,
)

PHOTONS_V0 = 1000.0
"""Flux of a star of V = 0 in photons / (s cm^2 Angstrom) (published, eq. 3.4.2)."""

WIDEST_PSF_PX = 20.0
"""Largest standard deviation of a spot in px (assumed): few stars would still be visible."""

Pixels = NDArray[np.float64]


class Distortion(Enum):
    """The direction in which the distortion coefficients map."""

    INVERSE = "inverse"
    TOOLBOX = "toolbox"


@dataclass(frozen=True, kw_only=True)
class Optics(DeclaredValues):
    """A lens in front of the sensor. Pixel coordinates have (0, 0) at the first pixel's centre.

    Coefficients are those of eqs. 4.1.3 and 4.1.4, for which INVERSE is exact; TOOLBOX is the model
    of the calibration toolbox, which has the same coefficients with inverted sign. ``psf_sigma_px``
    includes defocus; natural vignetting is 4. ``residuals`` are displacements of the picture that
    neither coefficients nor focal length describe.
    """

    error = SceneError

    focal_length_mm: float = positive(REQUIRED, "scale of directions")
    pixel_pitch_um: float = positive(REQUIRED, "of the sensor")
    fx: float = positive(
        REQUIRED, "scale of the distortion's normalised coordinates along a row", unit="px"
    )
    fy: float = positive(REQUIRED, "likewise along a column", unit="px")
    cx: float = number(REQUIRED, "principal point, column", unit="px")
    cy: float = number(REQUIRED, "principal point, row", unit="px")
    k1: float = number(0.0, "radial coefficient, distorted to undistorted")
    k2: float = number(0.0, "next radial coefficient")
    p1: float = number(0.0, "tangential coefficient")
    p2: float = number(0.0, "other tangential coefficient")
    distortion: Distortion = choice(
        Distortion.INVERSE,
        "direction in which the coefficients map",
        {one.value: one for one in Distortion},
    )
    psf_sigma_px: float = positive(
        REQUIRED, "standard deviation of a star's spot", high=WIDEST_PSF_PX
    )
    vignetting: float = number(0.0, "power of the cosine of the field angle: fall-off of the light")
    columns: int = whole(REQUIRED, "pixels of a row", 1)
    rows: int = whole(REQUIRED, "pixels of a column", 1)
    aperture_mm: float = positive(REQUIRED, "diameter of the entrance pupil")
    effective_width_a: float = positive(
        REQUIRED, "bandwidth in Angstrom times transmission times quantum efficiency"
    )
    field_stop_deg: float = positive(
        360.0, "diameter of the round field behind a shade; 360: no shade"
    )
    residuals: tuple[Displacement, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        y, x = np.mgrid[-0.5 : self.rows - 0.5 : 5j, -0.5 : self.columns - 0.5 : 9j]
        sensor = np.stack([x.ravel(), y.ravel()], axis=1)
        with np.errstate(all="ignore"):
            there_and_back = self.project(self.unproject(sensor))
        if not np.allclose(there_and_back, sensor, rtol=0, atol=1e-9):
            raise ValueError(
                f"distortion k1={self.k1} k2={self.k2} p1={self.p1} p2={self.p2} folds the picture "
                "within the sensor; choose smaller coefficients"
            )

    @property
    def basics(self) -> Lens:
        """The part of it that hazards can change."""
        f_number = self.focal_length_mm / self.aperture_mm
        return Lens(
            f_number,
            self.pixel_pitch_um,
            (self.rows, self.columns),
            (self.cx, self.cy),
            self.psf_sigma_px,
            residuals=self.residuals,
        )

    def changed(self, lens: Lens) -> "Optics":
        """These optics with the values of ``lens``; the same object if none differs."""
        if lens == self.basics:
            return self
        return replace(
            self,
            focal_length_mm=self.focal_length_mm * lens.scale,
            fx=self.fx * lens.scale,
            fy=self.fy * lens.scale,
            psf_sigma_px=lens.spot_px,
            residuals=lens.residuals,
        )

    def project(self, vectors: NDArray[np.float64]) -> Pixels:
        """Pixel coordinates (n, 2) of directions (n, 3) in camera axes, exact to 1e-9 px.

        Directions that this lens can not image become NaN: those behind it, and those more than a
        tenth beyond the sensor's corners, where the polynomial folds back.
        """
        v = np.asarray(vectors, np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            plane = v[:, :2] / v[:, 2:]
        imaged = (v[:, 2] > 0) & (np.hypot(plane[:, 0], plane[:, 1]) < self._edge_of_field)
        pixels = np.full((len(v), 2), np.nan)
        undistorted = plane[imaged] * self._focal_px / self._scale
        if self.distortion is Distortion.TOOLBOX:
            distorted = (-self._brown).of(undistorted)
        else:
            distorted = self._brown.inverse(undistorted)
        pixels[imaged] = displace(distorted * self._scale + (self.cx, self.cy), self.residuals)
        return pixels

    def may_meet(self, vectors: NDArray[np.float64], margin_px: float) -> NDArray[np.bool_]:
        """Whether directions (n, 3) in camera axes can be within ``margin_px`` of the sensor.

        Much faster than ``project``, and false for nearly all others.
        """
        x, y, z = vectors.T
        across, down = self._edge_tangents + 2 * margin_px / self._focal_px  # twice: distortion
        return np.asarray((z > 0) & (np.abs(x) < across * z) & (np.abs(y) < down * z))

    def unproject(self, pixels: Pixels) -> NDArray[np.float64]:
        """Unit vectors (n, 3) in camera axes of pixel coordinates (n, 2)."""
        points = restore(np.asarray(pixels, np.float64), self.residuals)
        distorted = (points - (self.cx, self.cy)) / self._scale
        if self.distortion is Distortion.TOOLBOX:
            undistorted = (-self._brown).inverse(distorted)
        else:
            undistorted = self._brown.of(distorted)
        plane = undistorted * self._scale / self._focal_px
        vectors = np.concatenate([plane, np.ones((len(plane), 1))], axis=1)
        vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
        return vectors

    def transmission(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Relative light (n,) of directions (n, 3) in camera axes, 1 on the axis."""
        cosine = np.clip(vectors[:, 2], 0, 1)
        light = cosine**self.vignetting if self.vignetting else np.ones_like(cosine)
        if self.field_stop_deg < 180:
            light[cosine < np.cos(np.radians(self.field_stop_deg / 2))] = 0
        return light

    def electrons_per_second(self, v_mag: ArrayLike) -> NDArray[np.float64]:
        """Electrons per second on the axis from stars of magnitude ``v_mag``; same shape."""
        area_cm2 = np.pi * (self.aperture_mm / 20) ** 2
        flux = PHOTONS_V0 * 10 ** (-0.4 * np.asarray(v_mag, np.float64))
        return np.asarray(area_cm2 * self.effective_width_a * flux, np.float64)

    @property
    def pixel_arcsec2(self) -> float:
        """Solid angle of a pixel on the axis in square arcseconds."""
        return float(np.degrees(1 / self._focal_px) * 3600) ** 2

    @cached_property
    def even_light(self) -> NDArray[np.float32]:
        """Relative light of each pixel (rows, columns) under a uniform sky, 1 on the axis."""
        y, x = np.mgrid[: self.rows, : self.columns]
        directions = self.unproject(np.stack([x.ravel(), y.ravel()], axis=1))
        return self.transmission(directions).reshape(self.rows, self.columns).astype(np.float32)

    @cached_property
    def half_field_deg(self) -> float:
        """Angle between the boresight and the farthest corner of the sensor."""
        return float(np.degrees(np.arccos(self.unproject(self._corners)[:, 2].min())))

    @property
    def _corners(self) -> Pixels:
        """The sensor's outer corners (4, 2), px."""
        x, y = self.columns - 0.5, self.rows - 0.5
        return np.array([[-0.5, -0.5], [x, -0.5], [-0.5, y], [x, y]])

    @cached_property
    def _brown(self) -> Brown:
        return Brown(self.k1, self.k2, self.p1, self.p2)

    @property
    def _focal_px(self) -> float:
        return self.focal_length_mm * 1000 / self.pixel_pitch_um

    @property
    def _scale(self) -> NDArray[np.float64]:
        return np.array([self.fx, self.fy])

    @cached_property
    def _edge_of_field(self) -> float:
        """Tangent of the field angle beyond which nothing is projected."""
        corners = self.unproject(self._corners)
        return 1.1 * float((np.hypot(corners[:, 0], corners[:, 1]) / corners[:, 2]).max())

    @cached_property
    def _edge_tangents(self) -> NDArray[np.float64]:
        """Largest tangents (2,) of directions on the sensor's edge, across and down."""
        share = np.linspace(0, 1, 65)
        zero, one = np.zeros_like(share), np.ones_like(share)
        sides = [(share, zero), (share, one), (zero, share), (one, share)]
        edge = np.concatenate([np.stack(side, axis=1) for side in sides])
        vectors = self.unproject(edge * (self.columns, self.rows) - 0.5)
        return np.asarray(np.abs(vectors[:, :2] / vectors[:, 2:]).max(axis=0))

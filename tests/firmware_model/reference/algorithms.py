"""The reference firmware's algorithms, compiled for the host and called with arrays."""

import ctypes
import shutil
import subprocess
from ctypes import POINTER, Structure, byref, c_bool, c_float, c_int, c_uint8, c_uint16, c_uint32
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.attitude.geometry import CameraParameters
from cubestack.firmware_model.cubestar.detection import DetectionConfig
from cubestack.firmware_model.interface.cubestar.telecommands import MOST_STARS
from cubestack.host.studies.cubestar.reference_catalogue import catalogue_tables

SOURCES = Path(__file__).parents[3] / "firmware_model" / "reference" / "algorithms"
Floats = NDArray[np.float32]

#: Single precision as IEEE 754 has it: nothing fused, nothing reordered.
FLAGS = ("-std=c11", "-O2", "-ffp-contract=off", "-shared", "-fPIC", "-Wall", "-Wextra", "-Werror")


class _Config(Structure):
    _fields_ = [
        *((name, c_uint16) for name in ("step", "x_start", "x_end", "y_start", "y_end")),
        *(
            (name, c_uint8)
            for name in (
                "detection_threshold",
                "star_threshold",
                "min_pixels",
                "max_pixels",
                "grid_size",
                "max_stars",
                "max_invalid",
                "max_noise",
            )
        ),
    ]


class Found(Structure):
    _fields_ = [
        ("count", c_int),
        ("centroids", c_float * (2 * MOST_STARS)),
        ("sizes", c_uint8 * MOST_STARS),
        ("intensities", c_uint16 * MOST_STARS),
        ("invalid", c_uint16),
        ("noise", c_uint16),
        ("dark_value", c_uint8),
        ("end", c_int),
    ]


class Identified(Structure):
    _fields_ = [
        ("count", c_int),
        ("stars", ctypes.c_int16 * MOST_STARS),
        ("votes", c_uint8 * MOST_STARS),
        ("outcome", c_int),
    ]


class _Camera(Structure):
    _fields_ = [
        (name, c_float)
        for name in ("focal_length_mm", "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2")
    ]


def _floats(values: Any) -> Any:
    return np.ascontiguousarray(values, np.float32).ctypes.data_as(POINTER(c_float))


class Algorithms:
    """Each function of the C program with the arguments of the Python one."""

    def __init__(self, folder: Path) -> None:
        """Compile into ``folder``; the test is skipped where there is no C compiler."""
        compiler = shutil.which("cc") or shutil.which("gcc")
        if compiler is None:
            pytest.skip("there is no C compiler")
        for name, text in catalogue_tables().items():
            (folder / name).write_text(text, encoding="utf-8")
        library = folder / "algorithms.so"
        sources = [*SOURCES.glob("*.c"), *folder.glob("*.c")]
        includes = [f"-I{path}" for path in (SOURCES, folder, Path(__file__).parent)]
        subprocess.run([compiler, *FLAGS, *includes, *sources, "-lm", "-o", library], check=True)
        self.library = ctypes.CDLL(str(library))
        self.library.quest.restype = c_bool
        self.library.detection_valid.restype = c_bool
        for name in ("arc_cosine", "arc_tangent", "sine", "cosine", "field_cosine", "confidence"):
            getattr(self.library, name).restype = c_float

    def call(self, name: str, *arguments: float) -> np.float32:
        return np.float32(getattr(self.library, name)(*map(c_float, arguments)))

    def detect(self, picture: NDArray[np.uint8], config: DetectionConfig) -> Found:
        """``detect_stars``; the picture is as before."""
        fields = {name: getattr(config, name) for name, _ in _Config._fields_}
        c_config, found = _Config(**fields), Found()
        assert self.library.detection_valid(byref(c_config))
        pixels, visited = picture.copy(), np.zeros(40_000, np.uint32)
        self.library.detect_stars(
            pixels.ctypes.data_as(POINTER(c_uint8)),
            visited.ctypes.data_as(POINTER(c_uint32)),
            byref(c_config),
            byref(found),
        )
        np.testing.assert_array_equal(pixels, picture)
        return found

    def undistort(self, points: Floats, camera: CameraParameters) -> Floats:
        """Undistorted points (n, 2)."""
        return self._points("undistort", points, camera, 2)

    def unit_vectors(self, points: Floats, camera: CameraParameters) -> Floats:
        """Camera vectors (n, 3)."""
        return self._points("unit_vectors", points, camera, 3)

    def _points(self, name: str, points: Floats, camera: CameraParameters, width: int) -> Floats:
        c_camera = _Camera(*(getattr(camera, field) for field, _ in _Camera._fields_))
        out = np.zeros((len(points), width), np.float32)
        getattr(self.library, name)(_floats(out), _floats(points), len(points), byref(c_camera))
        return out

    def field_cosine(self, camera: CameraParameters) -> np.float32:
        c_camera = _Camera(*(getattr(camera, field) for field, _ in _Camera._fields_))
        return np.float32(self.library.field_cosine(byref(c_camera)))

    def direction_of(self, right_ascension: float, declination: float) -> Floats:
        """Unit vector (3,)."""
        out = np.zeros(3, np.float32)
        self.library.direction_of(c_float(right_ascension), c_float(declination), _floats(out))
        return out

    def angles_of(self, direction: Floats) -> tuple[float, float]:
        """Right ascension and declination in rad."""
        ascension, declination = c_float(), c_float()
        self.library.angles_of(_floats(direction), byref(ascension), byref(declination))
        return ascension.value, declination.value

    def identify(self, directions: Floats, boresight: Floats | None, margin: float) -> Identified:
        result, near = Identified(), None if boresight is None else _floats(boresight)
        self.library.identify(
            byref(result), _floats(directions), len(directions), near, c_float(margin)
        )
        return result

    def track(self, directions: Floats, attitude: Floats) -> Identified:
        """From the last attitude (3, 3)."""
        result = Identified()
        self.library.track(byref(result), _floats(directions), len(directions), _floats(attitude))
        return result

    def best_stars(self, result: Identified, intensities: NDArray[np.uint16]) -> list[int]:
        best = (c_uint8 * 3)()
        pointer = intensities.ctypes.data_as(POINTER(c_uint16))
        count: int = self.library.best_stars(byref(result), pointer, best)
        return list(best[:count])

    def confidence(self, result: Identified, star: int) -> np.float32:
        return np.float32(self.library.confidence(byref(result), star))

    def count_near(self, boresight: Floats, least: np.float32) -> int:
        """Stars whose cosine is ``least`` or more."""
        return int(self.library.count_near(_floats(boresight), c_float(least)))

    def quest(self, measured: Floats, reference: Floats, weights: Floats) -> Floats | None:
        out = np.zeros(4, np.float32)
        arrays = map(_floats, (measured, reference, weights))
        return out if self.library.quest(_floats(out), *arrays, len(measured)) else None

    def dcm(self, quaternion: Floats) -> Floats:
        """Direction cosine matrix (3, 3)."""
        out = np.zeros((3, 3), np.float32)
        self.library.dcm(_floats(out), _floats(quaternion))
        return out

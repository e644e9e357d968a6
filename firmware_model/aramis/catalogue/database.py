"""The star tracker's database as bytes in flash: stars, triangles, k-vectors and faces.

AraMiS thesis, sections 5.5 (triangle database), 5.6 (k-vectors), 5.9 (faces) and 2.3.3 (the program
works on a copy in RAM). The thesis estimates its database as a text file of doubles, 21.2 MB
(section 2.3.2); this one is binary, little-endian, without gaps:

- `HEADER`; the arrays of `LAYOUT` in order, whose lengths follow from the header's counts;
- a CRC-32 of everything before it. The flash store adds the error-correcting code.

Triangles are sorted by area; a second list has the moments in ascending order, each with its
triangle. Stars of a triangle are ascending indices into the star list.
"""

import struct
from dataclasses import dataclass
from typing import Any, Self
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Floats
from cubestack.firmware_model.aramis.catalogue.geodesic import GeodesicSphere
from cubestack.firmware_model.aramis.catalogue.kvector import KVector

MAGIC = b"ARAM"
VERSION = 1

HEADER = struct.Struct("<4sHHIIIIHH6f")
"""Magic, version, 0; stars, triangles, bins of area and moment; faces, neighbours of a face;
epoch, field in degrees, bounds of area and of moment."""

#: Arrays of the image: name, type of an element, elements of an entry.
LAYOUT = (
    ("numbers", "<u4", 1),  # Hipparcos numbers, for the report
    ("vectors", "<f4", 3),  # inertial unit vectors
    ("v_mag", "<f4", 1),  # V magnitudes
    ("stars", "<u2", 3),  # of each triangle
    ("faces", "<u2", 1),  # of each triangle
    ("areas", "<f4", 1),  # rising
    ("moments", "<f4", 1),  # rising
    ("moment_triangles", "<u4", 1),  # triangle of each entry of moments
    ("area_starts", "<u4", 1),  # k-vector
    ("moment_starts", "<u4", 1),  # k-vector
    ("centres", "<f4", 3),  # of the faces
    ("neighbours", "<u2", 12),  # of each face
)

MOST_STARS = 0xFFFF
MOST_TRIANGLES = 1 << 24


class DatabaseError(ValueError):
    """Invalid bytes or arrays of a database; the message gives the reason."""


@dataclass(frozen=True, eq=False)
class Database:
    """Onboard database for one field of view and epoch."""

    epoch: float  #: Julian year of the directions
    fov_deg: float  #: longest side of a triangle
    numbers: NDArray[np.uint32]  #: (n,) Hipparcos numbers, uint32
    vectors: Floats  #: (n, 3) inertial unit vectors, float32
    v_mag: Floats  #: (n,) V magnitudes, float32
    stars: NDArray[np.uint16]  #: (m, 3) star indices of each triangle, ascending, uint16
    faces: NDArray[np.uint16]  #: (m,) face of each triangle's middle, uint16
    areas: Floats  #: (m,) ascending, float32
    moments: Floats  #: (m,) ascending, float32
    moment_triangles: NDArray[np.uint32]  #: (m,) triangle of each moment, uint32
    #: area_index, moment_index: k-vectors of both
    area_index: KVector
    moment_index: KVector
    sphere: GeodesicSphere  #: the faces

    def __len__(self) -> int:
        return len(self.areas)

    @property
    def sizes(self) -> dict[str, int]:
        """Bytes of each part of the image; their sum is the image's length."""
        arrays = {name: self._array(name).nbytes for name, _, _ in LAYOUT}
        return {"header": HEADER.size, **arrays, "checksum": 4}

    def pack(self) -> bytes:
        area, moment = self.area_index, self.moment_index
        counts = len(self.numbers), len(self), area.bins, moment.bins, *self.sphere.neighbours.shape
        bounds = area.lowest, area.highest, moment.lowest, moment.highest
        header = HEADER.pack(MAGIC, VERSION, 0, *counts, self.epoch, self.fov_deg, *bounds)
        parts = (self._array(name).astype(kind).tobytes() for name, kind, _ in LAYOUT)
        body = header + b"".join(parts)
        return body + struct.pack("<I", crc32(body))

    @classmethod
    def unpack(cls, image: bytes | bytearray | memoryview) -> Self:
        """Database of an image; its arrays share the image's bytes.

        Raises:
            DatabaseError: for a wrong magic, version, length or checksum, and for indices beyond
                their lists.
        """
        if len(image) < HEADER.size + 4:
            raise DatabaseError(f"an image has at least {HEADER.size + 4} bytes, not {len(image)}")
        magic, version, _, stars, triangles, areas, moments, faces, width, *numbers = (
            HEADER.unpack_from(image)
        )
        if magic != MAGIC or version != VERSION:
            raise DatabaseError(
                f"an image starts with {MAGIC!r} version {VERSION}, not {magic!r} {version}"
            )
        if not (1 <= stars <= MOST_STARS and 1 <= triangles <= MOST_TRIANGLES and width == 12):
            raise DatabaseError(
                f"{stars} stars, {triangles} triangles and {width} neighbours of a face are not "
                f"1 to {MOST_STARS}, 1 to {MOST_TRIANGLES} and 12"
            )
        counts = [stars] * 3 + [triangles] * 5 + [areas + 1, moments + 1] + [faces] * 2
        parts = zip(counts, LAYOUT, strict=True)
        sizes = [count * width * np.dtype(kind).itemsize for count, (_, kind, width) in parts]
        length = HEADER.size + sum(sizes) + 4
        if len(image) != length:
            raise DatabaseError(f"the image's counts need {length} bytes, not {len(image)}")
        if crc32(image[:-4]) != struct.unpack("<I", image[-4:])[0]:
            raise DatabaseError("the image's CRC-32 does not fit its bytes; load it again")
        arrays: dict[str, NDArray[Any]] = {}
        offset = HEADER.size
        for count, (name, kind, width) in zip(counts, LAYOUT, strict=True):
            flat: NDArray[Any] = np.frombuffer(image, kind, count * width, offset)
            offset += flat.nbytes
            arrays[name] = flat.reshape(count, width) if width > 1 else flat
        _check(arrays, stars, triangles, faces)
        epoch, fov_deg, *bounds = numbers
        low_area, high_area, low_moment, high_moment = map(np.float32, bounds)
        return cls(
            epoch=epoch,
            fov_deg=fov_deg,
            area_index=KVector(low_area, high_area, arrays.pop("area_starts")),
            moment_index=KVector(low_moment, high_moment, arrays.pop("moment_starts")),
            sphere=GeodesicSphere(arrays.pop("centres"), arrays.pop("neighbours")),
            **arrays,
        )

    def _array(self, name: str) -> NDArray[Any]:
        parts: dict[str, NDArray[Any]] = {
            "area_starts": self.area_index.starts,
            "moment_starts": self.moment_index.starts,
            "centres": self.sphere.centres,
            "neighbours": self.sphere.neighbours,
        }
        return parts[name] if name in parts else np.asarray(getattr(self, name))


def _check(arrays: dict[str, NDArray[Any]], stars: int, triangles: int, faces: int) -> None:
    """Reject an image that would make the program read beyond its lists."""
    limits = {
        "stars": stars,
        "faces": faces,
        "moment_triangles": triangles,
        "area_starts": triangles + 1,
        "moment_starts": triangles + 1,
    }
    for name, limit in limits.items():
        if int(arrays[name].max()) >= limit:
            raise DatabaseError(f"{name} of the image reach {arrays[name].max()}, not {limit - 1}")
    for name in ("area_starts", "moment_starts"):
        if (np.diff(arrays[name].astype(np.int64)) < 0).any():
            raise DatabaseError(f"{name} of the image fall; they must rise")
    for name in ("vectors", "areas", "moments", "centres"):
        if not np.isfinite(arrays[name]).all():
            raise DatabaseError(f"{name} of the image are not all finite")

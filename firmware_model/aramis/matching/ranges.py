"""Triangles of the database in ranges of its moments, within bounds of their areas."""

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Indices, Mask
from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.mcu.inner_loops import INT, INTS, POINTER, Loop, address

_WITHIN = Loop("triples_within", POINTER, INT, *[INTS] * 4, POINTER, POINTER, INT, POINTER, INTS)


def triangles_within(
    database: Database,
    ranges: tuple[Indices, Indices],
    areas: tuple[Indices, Indices],
    faces: Mask | None,
) -> tuple[NDArray[np.uint32], Indices]:
    """Triangles of all ranges, one after the other, and the number of each (n,).

    Args:
        ranges: first moment and number of moments (n,) of each.
        areas: first triangle, and that after the last one (n,); triangles rise with their areas.
        faces: (f,) which faces count; None: all.
    """
    starts, lengths = ranges
    if _WITHIN and database.moment_triangles.flags.c_contiguous:
        found, kept = np.empty(int(lengths.sum()), np.uint32), np.empty(len(starts), np.int64)
        bounds = [np.ascontiguousarray(one, np.int64) for one in (*ranges, *areas)]
        of_faces = (0, 0, 0)
        if faces is not None:
            of_faces = address(database.faces), address(faces), len(faces)
        moments = address(database.moment_triangles)
        total = _WITHIN(moments, len(starts), *bounds, *of_faces, address(found), kept)
        if total >= 0:
            return found[:total], kept
    parts = [np.zeros(0, np.uint32)]
    for start, length, first, last in zip(starts, lengths, *areas, strict=True):
        part = database.moment_triangles[start : start + length]
        part = part[(part >= first) & (part < last)]
        parts.append(part if faces is None else part[faces[database.faces[part]]])
    return np.concatenate(parts), np.array([len(part) for part in parts[1:]], np.int64)

"""CubeSense's telemetry of our own, IDs from 220 on: what a measurement rests on, its times."""

from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.cubesense.codes import (
    EDGE_UNIT,
    EDGES_PER_FRAME,
    Camera,
    NadirSearch,
    Sram,
)

__all__ = ["EXTENSIONS"]


def _details(camera: Camera) -> Message:
    return Message(
        220 + camera,
        f"Details{camera + 1}",
        16,
        f"what the latest measurement of camera {camera + 1} rests on",
        (
            Field("X", "i16", 0, "centre from the boresight, undistorted column", "px", 100),
            Field("Y", "i16", 16, "centre from the boresight, undistorted row", "px", 100),
            Field("Radius", "u16", 32, "fitted circle, undistorted; 0 for the Sun", "px", 100),
            Field("Points", "u8", 48, "edges of the fit, or Sun pixels of the mean"),
            Field("Sram", "u8", 56, "memory that held the picture", choices=Sram),
            Field("FirstX", "u16", 64, "first Sun pixel's column; 0 for the nadir camera", "px"),
            Field("FirstY", "u16", 80, "first Sun pixel's row; 0 for the nadir camera", "px"),
            Field("PixelsRead", "u32", 96, "pixels that the processor read from the FPGA"),
        ),
        ours=True,
    )


def _times(camera: Camera) -> Message:
    phases = (
        ("Wait", "from the start until the picture's first row arrives"),
        ("Store", "while the picture is stored"),
        ("Search", "reading and searching lines, or reading the Sun's window"),
        ("Centroid", "distortion and fit, or weighted mean and distortion"),
        ("Total", "from the start until the centre is known"),
    )
    return Message(
        222 + camera,
        f"PhaseTimes{camera + 1}",
        4 * len(phases),
        f"times of the latest measurement of camera {camera + 1}",
        tuple(
            Field(name, "u32", 32 * index, meaning, "us")
            for index, (name, meaning) in enumerate(phases)
        ),
        ours=True,
    )


def _edges(part: int) -> Message:
    first = part * EDGES_PER_FRAME + 1
    last = first + EDGES_PER_FRAME - 1
    coordinates = [
        Field(
            f"{axis}{first + index}",
            "i16",
            8 + 32 * index + 16 * offset,
            f"{line} of edge {first + index} in the picture; 0 where there is none",
            "px",
            EDGE_UNIT,
        )
        for index in range(EDGES_PER_FRAME)
        for offset, (axis, line) in enumerate((("X", "column"), ("Y", "row")))
    ]
    return Message(
        225 + part,
        f"NadirEdges{part + 1}",
        1 + 4 * EDGES_PER_FRAME,
        f"edges {first} to {last} that the latest search in the nadir picture found",
        (Field("Count", "u8", 0, "edges found in all, false ones left out"), *coordinates),
        ours=True,
    )


EXTENSIONS = (
    *(_details(camera) for camera in Camera),
    *(_times(camera) for camera in Camera),
    Message(
        224,
        "NadirSearchMode",
        1,
        "how the nadir camera's edges are looked for",
        (Field("Search", "u8", 0, "way of the search", choices=NadirSearch),),
        ours=True,
    ),
    *(_edges(part) for part in range(2)),
)

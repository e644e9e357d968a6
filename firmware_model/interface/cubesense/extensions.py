"""CubeSense's telemetry beyond the published one, IDs from 220 on: details, accuracy and times.

Also the telecommands that change the switches, and the telemetry that shows them.
"""

from functools import partial

from cubestack.firmware_model.interface.codec.field import i16, u8, u16, u32
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.codec.switch_messages import switch_messages
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.interface.cubesense.switches import CubeSenseSwitches

*SET_SWITCHES, _SHOWN = switch_messages(CubeSenseSwitches, 101, 227, "lost at a program restart")

_extension = partial(Message, extension=True)


def _details(camera: codes.Camera) -> Message:
    return _extension(
        220 + camera,
        f"Details{camera + 1}",
        f"details of the latest measurement of camera {camera + 1}",
    ).of(
        i16("X", "undistorted column of the centre, from the boresight", "px", 100),
        i16("Y", "undistorted row of the centre, from the boresight", "px", 100),
        u16("Radius", "fitted circle, undistorted; 0 for the Sun", "px", 100),
        u8("Points", "edges of the fit, or Sun pixels of the mean"),
        u8("Sram", "memory that held the image", choices=codes.Sram),
        u16("FirstX", "first Sun pixel's column; 0 for the nadir camera", "px"),
        u16("FirstY", "first Sun pixel's row; 0 for the nadir camera", "px"),
        u32("PixelsRead", "pixels that the processor read from the FPGA"),
    )


def _times(camera: codes.Camera) -> Message:
    phases = (
        ("Wait", "from the start until the image's first row arrives"),
        ("Store", "while the image is stored"),
        ("Search", "reading and searching lines, or reading the Sun's window"),
        ("Centroid", "distortion and fit, or weighted mean and distortion"),
        ("Total", "from the start to the result"),
    )
    return _extension(
        222 + camera,
        f"PhaseTimes{camera + 1}",
        f"times of the latest measurement of camera {camera + 1}",
    ).of(*(u32(name, meaning, "us") for name, meaning in phases))


def _edges(part: int) -> Message:
    first = part * codes.EDGES_PER_FRAME + 1
    last = first + codes.EDGES_PER_FRAME - 1
    coordinates = [
        i16(
            f"{axis}{first + index}",
            f"{line} of edge {first + index} in the image; 0 if there is none",
            "px",
            codes.EDGE_UNIT,
        )
        for index in range(codes.EDGES_PER_FRAME)
        for axis, line in (("X", "column"), ("Y", "row"))
    ]
    return _extension(
        225 + part,
        f"NadirEdges{part + 1}",
        f"edges {first} to {last} that the latest search in the nadir image found",
    ).of(u8("Count", "total number of edges, without false ones"), *coordinates)


def _quality(camera: codes.Camera) -> Message:
    return _extension(
        228 + camera,
        f"Quality{camera + 1}",
        f"accuracy of the latest measurement of camera {camera + 1}, or why there is none",
    ).of(
        u16("SigmaAlpha", "standard deviation of Alpha; 0: unknown", "deg", 100),
        u16("SigmaBeta", "standard deviation of Beta; 0: unknown", "deg", 100),
        u16("Rms", "distances of the edges from the circle; 0 for the Sun", "px", 100),
        u8("Found", "edges that the search found, or Sun pixels"),
        u8("Reason", "why the detection ended as it did", choices=codes.Reason),
    )


EXTENSIONS = (
    *(_details(camera) for camera in codes.Camera),
    *(_times(camera) for camera in codes.Camera),
    _extension(224, "NadirSearchMode", "search method for the nadir camera's edges").of(
        u8("Search", "method", choices=codes.NadirSearch)
    ),
    *(_edges(part) for part in range(2)),
    _SHOWN,
    *(_quality(camera) for camera in codes.Camera),
)

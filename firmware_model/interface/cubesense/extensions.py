"""CubeSense's telemetry beyond the published one, IDs from 220 on: details, accuracy and times.

Also the telecommands that change the switches, and the telemetry that shows them.
"""

from functools import partial

from cubestack.firmware_model.interface.codec.field import i16, u8, u16, u32
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.codec.switch_messages import switch_messages
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.interface.cubesense.switches import CubeSenseSwitches

*SET_SWITCHES, _SHOWN = switch_messages(
    CubeSenseSwitches, 101, 227, "lost when the program restarts"
)

_extension = partial(Message, extension=True)


def _details(camera: codes.Camera) -> Message:
    return _extension(
        220 + camera,
        f"Details{camera + 1}",
        f"what the latest measurement of camera {camera + 1} rests on",
    ).of(
        i16("X", "centre from the boresight, undistorted column", "px", 100),
        i16("Y", "centre from the boresight, undistorted row", "px", 100),
        u16("Radius", "fitted circle, undistorted; 0 for the Sun", "px", 100),
        u8("Points", "edges of the fit, or Sun pixels of the mean"),
        u8("Sram", "memory that held the picture", choices=codes.Sram),
        u16("FirstX", "first Sun pixel's column; 0 for the nadir camera", "px"),
        u16("FirstY", "first Sun pixel's row; 0 for the nadir camera", "px"),
        u32("PixelsRead", "pixels that the processor read from the FPGA"),
    )


def _times(camera: codes.Camera) -> Message:
    phases = (
        ("Wait", "from the start until the picture's first row arrives"),
        ("Store", "while the picture is stored"),
        ("Search", "reading and searching lines, or reading the Sun's window"),
        ("Centroid", "distortion and fit, or weighted mean and distortion"),
        ("Total", "from the start until the centre is known"),
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
            f"{line} of edge {first + index} in the picture; 0 where there is none",
            "px",
            codes.EDGE_UNIT,
        )
        for index in range(codes.EDGES_PER_FRAME)
        for axis, line in (("X", "column"), ("Y", "row"))
    ]
    return _extension(
        225 + part,
        f"NadirEdges{part + 1}",
        f"edges {first} to {last} that the latest search in the nadir picture found",
    ).of(u8("Count", "edges found in all, false ones left out"), *coordinates)


def _quality(camera: codes.Camera) -> Message:
    return _extension(
        228 + camera,
        f"Quality{camera + 1}",
        f"how sure the latest measurement of camera {camera + 1} is, and why there is none",
    ).of(
        u16("SigmaAlpha", "standard deviation of Alpha; 0: not known", "deg", 100),
        u16("SigmaBeta", "standard deviation of Beta; 0: not known", "deg", 100),
        u16("Rms", "distances of the edges from the circle; 0 for the Sun", "px", 100),
        u8("Found", "edges that the search found, or Sun pixels"),
        u8("Reason", "why the detection ended so", choices=codes.Reason),
    )


EXTENSIONS = (
    *(_details(camera) for camera in codes.Camera),
    *(_times(camera) for camera in codes.Camera),
    _extension(224, "NadirSearchMode", "how the nadir camera's edges are looked for").of(
        u8("Search", "way of the search", choices=codes.NadirSearch)
    ),
    *(_edges(part) for part in range(2)),
    _SHOWN,
    *(_quality(camera) for camera in codes.Camera),
)

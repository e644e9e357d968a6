"""CubeSense's telecommands, with the extensions that are ours (IDs from 100 on).

CubeSpace family of nodes with two cameras, interface generation 2: IDs, lengths and parameters as
hosts use them; names, limits and reset values are ours. Reset values follow the CubeSense thesis:
thresholds section 4.3, boresights Table 5.1, distortion equation 5.2.3, exposure of the Sun's
camera section 3.2; that of the nadir camera is assumed.
"""

from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.message import Confidence, Message
from cubestack.firmware_model.interface.cubesense.codes import (
    COLUMNS,
    MASK_AREAS,
    ROWS,
    Camera,
    ImageLocation,
    ImageSize,
    NadirSearch,
    ResetTarget,
    Sram,
    SramSelection,
    split_coefficient,
)

__all__ = ["DISTORTION", "DISTORTION_TERMS", "TELECOMMANDS"]

#: r_d = sum of DISTORTION[k] r_u^k, both radii in px from the boresight.
DISTORTION = (0.1036, 0.9953, 7.6076e-5, -2.5572e-6, 0.0)

DISTORTION_TERMS = len(DISTORTION)

_HIGH, _MEDIUM, _LOW = Confidence.HIGH, Confidence.MEDIUM, Confidence.LOW

_NAMES = {Camera.SUN: "the Sun camera", Camera.NADIR: "the nadir camera"}
_THRESHOLDS = {Camera.SUN: 225, Camera.NADIR: 70}
_EXPOSURES = {Camera.SUN: 1, Camera.NADIR: 4}
_BORESIGHTS = {Camera.SUN: (369.0, 250.0), Camera.NADIR: (371.0, 236.0)}


def _camera(offset: int) -> Field:
    return Field("Camera", "u8", offset, "camera that takes the picture", choices=Camera)


def _sram(offset: int, meaning: str) -> Field:
    return Field("Sram", "u8", offset, meaning, choices=Sram)


def _location(offset: int) -> Field:
    return Field(
        "Location",
        "u8",
        offset,
        "half of the memory; one picture fills it",
        choices=ImageLocation,
        maximum=ImageLocation.TOP,
    )


def _threshold(camera: Camera) -> Message:
    number = camera + 1
    return Message(
        40 + camera,
        f"DetectionThreshold{number}",
        1,
        f"threshold of camera {number}, {_NAMES[camera]}",
        (
            Field(
                "Threshold",
                "u8",
                0,
                "a pixel at or above it is bright",
                "DN",
                reset=_THRESHOLDS[camera],
            ),
        ),
        confidence=_HIGH,
    )


def _auto_adjust(camera: Camera) -> Message:
    number = camera + 1
    return Message(
        42 + 2 * camera,
        f"AutoAdjust{number}",
        1,
        f"automatic exposure and gain of camera {number}, {_NAMES[camera]}",
        (Field("Enabled", "u8", 0, "1: the camera adjusts itself", maximum=1),),
        confidence=_HIGH,
    )


def _settings(camera: Camera) -> Message:
    number = camera + 1
    return Message(
        43 + 2 * camera,
        f"CameraSettings{number}",
        5,
        f"settings of camera {number}, {_NAMES[camera]}",
        (
            Field(
                "Exposure",
                "u16",
                0,
                "in two line times, 127 us; the camera gets at most 255",
                reset=_EXPOSURES[camera],
            ),
            Field("Gain", "u8", 16, "amplification; the camera gets at most 63"),
            Field("BlueGain", "u8", 24, "gain of the blue channel", reset=0x80),
            Field("RedGain", "u8", 32, "gain of the red channel", reset=0x80),
        ),
        confidence=_HIGH,
    )


def _boresight(camera: Camera) -> Message:
    number = camera + 1
    x, y = _BORESIGHTS[camera]
    return Message(
        50 + camera,
        f"Boresight{number}",
        4,
        f"pixel of the optical axis of camera {number}, {_NAMES[camera]}",
        (
            Field("X", "u16", 0, "column", "px", 100, maximum=COLUMNS - 1, reset=x),
            Field("Y", "u16", 16, "row", "px", 100, maximum=ROWS - 1, reset=y),
        ),
        confidence=_LOW,
    )


def _mask(camera: Camera) -> Message:
    number = camera + 1
    return Message(
        52 + camera,
        f"Mask{number}",
        9,
        f"area that detection ignores, camera {number}; ends included, all 0: none",
        (
            Field("Area", "u8", 0, "number of the area", minimum=1, maximum=MASK_AREAS, reset=1),
            Field("XMin", "u16", 8, "first column", "px", maximum=COLUMNS - 1),
            Field("XMax", "u16", 24, "last column", "px", maximum=COLUMNS - 1),
            Field("YMin", "u16", 40, "first row", "px", maximum=ROWS - 1),
            Field("YMax", "u16", 56, "last row", "px", maximum=ROWS - 1),
        ),
        ordered=(("XMin", "XMax"), ("YMin", "YMax")),
        confidence=_LOW,
    )


def _distortion(camera: Camera) -> Message:
    number = camera + 1
    fields: list[Field] = []
    for power, value in enumerate(DISTORTION):
        mantissa, exponent = split_coefficient(value)
        fields += [
            Field(
                f"Mantissa{power}",
                "i16",
                24 * power,
                f"of the factor of r_u^{power}; signed is ours",
                reset=mantissa,
            ),
            Field(
                f"Exponent{power}",
                "u8",
                24 * power + 16,
                "negative power of ten; ours",
                reset=exponent,
            ),
        ]
    return Message(
        54 + camera,
        f"Distortion{number}",
        3 * DISTORTION_TERMS,
        f"distorted radius as a polynomial of the undistorted one in px, camera {number}",
        tuple(fields),
        confidence=_LOW,
    )


_NODE = (
    Message(
        0,
        "Reset",
        1,
        "restart a part of the node",
        (
            Field(
                "Target",
                "u8",
                0,
                "what restarts",
                choices=ResetTarget,
                reset=ResetTarget.COMMUNICATION,
            ),
        ),
        confidence=_HIGH,
    ),
    Message(
        11,
        "ClearOverCurrent",
        1,
        "clear over-current flags of the memories, and switch those on again",
        (Field("Selection", "u8", 0, "which memories", choices=SramSelection),),
        confidence=_LOW,
    ),
)

_MEASUREMENT = (
    Message(
        20,
        "CaptureAndDetect",
        2,
        "take a picture and measure in it; results become pending at once",
        (_camera(0), _sram(8, "memory that stores it")),
        confidence=_HIGH,
    ),
    Message(
        21,
        "CaptureOnly",
        3,
        "take a picture; the capture result becomes pending at once",
        (_camera(0), _sram(8, "memory that stores it"), _location(16)),
        confidence=_MEDIUM,
    ),
)

_DOWNLOAD = (
    Message(
        64,
        "StartImageDownload",
        3,
        "select a picture and its size, and prepare frame 0",
        (
            _sram(0, "memory that is read"),
            _location(8),
            Field("Size", "u8", 16, "side of the square", choices=ImageSize),
        ),
        confidence=_HIGH,
    ),
    Message(
        65,
        "NextImageFrame",
        2,
        "prepare a frame of the picture that StartImageDownload selected",
        (
            Field(
                "Frame",
                "u16",
                0,
                "number from 0, row after row; must exist in the selected size",
                maximum=ImageSize.SIDE_1024.frames - 1,
            ),
        ),
        confidence=_HIGH,
    ),
)

_EXTENSIONS = (
    Message(
        100,
        "SetNadirSearch",
        1,
        "how the nadir camera's edges are looked for",
        (Field("Search", "u8", 0, "way of the search", choices=NadirSearch),),
        ours=True,
    ),
)

TELECOMMANDS = (
    *_NODE,
    *_MEASUREMENT,
    *sorted(
        (make(camera) for make in (_threshold, _auto_adjust, _settings) for camera in Camera),
        key=lambda message: message.id,
    ),
    *(make(camera) for make in (_boresight, _mask, _distortion) for camera in Camera),
    *_DOWNLOAD,
    *_EXTENSIONS,
)

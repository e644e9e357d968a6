"""CubeSense's telecommands, with the extensions (IDs from 100 on).

CubeSpace family of nodes with two cameras, interface generation 2: IDs, lengths and parameters as
hosts use them; names and limits are assumed. Reset values follow the CubeSense thesis: thresholds
section 4.3, boresights Table 5.1, distortion equation 5.2.3, exposure of the Sun's
camera section 3.2; that of the nadir camera is assumed.
"""

from cubestack.firmware_model.interface.codec.field import Field, i16, u8, u16
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


def _camera() -> Field:
    return u8("Camera", "camera that takes the picture", choices=Camera)


def _sram(meaning: str) -> Field:
    return u8("Sram", meaning, choices=Sram)


def _location() -> Field:
    return u8(
        "Location",
        "half of the memory; one picture fills it",
        choices=ImageLocation,
        maximum=ImageLocation.TOP,
    )


def _threshold(camera: Camera) -> Message:
    number = camera + 1
    return Message(
        40 + camera,
        f"DetectionThreshold{number}",
        f"threshold of camera {number}, {_NAMES[camera]}",
        confidence=_HIGH,
    ).of(u8("Threshold", "a pixel at or above it is bright", "DN", reset=_THRESHOLDS[camera]))


def _auto_adjust(camera: Camera) -> Message:
    number = camera + 1
    return Message(
        42 + 2 * camera,
        f"AutoAdjust{number}",
        f"automatic exposure and gain of camera {number}, {_NAMES[camera]}",
        confidence=_HIGH,
    ).of(u8("Enabled", "1: the camera adjusts itself", maximum=1))


def _settings(camera: Camera) -> Message:
    number = camera + 1
    return Message(
        43 + 2 * camera,
        f"CameraSettings{number}",
        f"settings of camera {number}, {_NAMES[camera]}",
        confidence=_HIGH,
    ).of(
        u16(
            "Exposure",
            "in two line times, 127 us; the camera gets at most 255",
            reset=_EXPOSURES[camera],
        ),
        u8("Gain", "amplification; the camera gets at most 63"),
        u8("BlueGain", "gain of the blue channel", reset=0x80),
        u8("RedGain", "gain of the red channel", reset=0x80),
    )


def _boresight(camera: Camera) -> Message:
    number = camera + 1
    x, y = _BORESIGHTS[camera]
    return Message(
        50 + camera,
        f"Boresight{number}",
        f"pixel of the optical axis of camera {number}, {_NAMES[camera]}",
        confidence=_LOW,
    ).of(
        u16("X", "column", "px", 100, maximum=COLUMNS - 1, reset=x),
        u16("Y", "row", "px", 100, maximum=ROWS - 1, reset=y),
    )


def _mask(camera: Camera) -> Message:
    number = camera + 1
    return Message(
        52 + camera,
        f"Mask{number}",
        f"area that detection ignores, camera {number}; ends included, all 0: none",
        confidence=_LOW,
    ).of(
        u8("Area", "number of the area", reset=1).within(1, MASK_AREAS),
        u16("XMin", "first column", "px", maximum=COLUMNS - 1),
        u16("XMax", "last column", "px", maximum=COLUMNS - 1),
        u16("YMin", "first row", "px", maximum=ROWS - 1),
        u16("YMax", "last row", "px", maximum=ROWS - 1),
        ordered=(("XMin", "XMax"), ("YMin", "YMax")),
    )


def _distortion(camera: Camera) -> Message:
    number = camera + 1
    fields: list[Field] = []
    for power, value in enumerate(DISTORTION):
        mantissa, exponent = split_coefficient(value)
        fields += [
            i16(
                f"Mantissa{power}", f"of the factor of r_u^{power}; signed is ours", reset=mantissa
            ),
            u8(f"Exponent{power}", "negative power of ten; ours", reset=exponent),
        ]
    return Message(
        54 + camera,
        f"Distortion{number}",
        f"distorted radius as a polynomial of the undistorted one in px, camera {number}",
        confidence=_LOW,
    ).of(*fields)


_NODE = (
    Message(0, "Reset", "restart a part of the node", confidence=_HIGH).of(
        u8("Target", "what restarts", choices=ResetTarget, reset=ResetTarget.COMMUNICATION)
    ),
    Message(
        11,
        "ClearOverCurrent",
        "clear over-current flags of the memories, and switch those on again",
        confidence=_LOW,
    ).of(u8("Selection", "which memories", choices=SramSelection)),
)

_MEASUREMENT = (
    Message(
        20,
        "CaptureAndDetect",
        "take a picture and measure in it; results become pending at once",
        confidence=_HIGH,
    ).of(
        _camera(),
        _sram("memory that stores it"),
    ),
    Message(
        21,
        "CaptureOnly",
        "take a picture; the capture result becomes pending at once",
        confidence=_MEDIUM,
    ).of(
        _camera(),
        _sram("memory that stores it"),
        _location(),
    ),
)

_DOWNLOAD = (
    Message(
        64,
        "StartImageDownload",
        "select a picture and its size, and prepare frame 0",
        confidence=_HIGH,
    ).of(
        _sram("memory that is read"),
        _location(),
        u8("Size", "side of the square", choices=ImageSize),
    ),
    Message(
        65,
        "NextImageFrame",
        "prepare a frame of the picture that StartImageDownload selected",
        confidence=_HIGH,
    ).of(
        u16(
            "Frame",
            "number from 0, row after row; must exist in the selected size",
            maximum=ImageSize.SIDE_1024.frames - 1,
        )
    ),
)

_EXTENSIONS = (
    Message(
        100, "SetNadirSearch", "how the nadir camera's edges are looked for", extension=True
    ).of(u8("Search", "way of the search", choices=NadirSearch)),
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

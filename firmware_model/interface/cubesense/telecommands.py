"""CubeSense's telecommands, with the extensions (IDs from 100 on).

CubeSpace family of nodes with two cameras, interface generation 2: IDs, lengths and parameters as
hosts use them; names and limits are assumed. Reset values follow the CubeSense thesis: thresholds
section 4.3, boresights Table 5.1, distortion equation 5.2.3, exposure of the Sun camera section
3.2; that of the nadir camera is assumed.
"""

from collections.abc import Iterator
from functools import partial

from cubestack.firmware_model.interface.codec.field import Field, i16, u8, u16
from cubestack.firmware_model.interface.codec.message import Confidence, Message
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.interface.cubesense.extensions import SET_SWITCHES

#: r_d = sum of DISTORTION[k] r_u^k, both radii in px from the boresight.
DISTORTION = (0.1036, 0.9953, 7.6076e-5, -2.5572e-6, 0.0)

DISTORTION_TERMS = len(DISTORTION)

_high = partial(Message, confidence=Confidence.HIGH)
_medium = partial(Message, confidence=Confidence.MEDIUM)
_low = partial(Message, confidence=Confidence.LOW)

_NAMES = {codes.Camera.SUN: "the Sun camera", codes.Camera.NADIR: "the nadir camera"}
_THRESHOLDS = {codes.Camera.SUN: 225, codes.Camera.NADIR: 70}  # chosen by section 5.7
_EXPOSURES = {codes.Camera.SUN: 1, codes.Camera.NADIR: 4}
_BORESIGHTS = {codes.Camera.SUN: (369.0, 250.0), codes.Camera.NADIR: (371.0, 236.0)}


_CAMERA = u8("Camera", "camera that captures the image", choices=codes.Camera)
_TO_SRAM = u8("Sram", "memory that stores it", choices=codes.Sram)
_LOCATION = u8(
    "Location",
    "half of the memory; one image fills it",
    choices=codes.ImageLocation,
    high=codes.ImageLocation.TOP,
)


def _of_camera(camera: codes.Camera) -> tuple[Message, ...]:
    """Settings of a camera; the tables number cameras from 1."""
    number, name = camera + 1, _NAMES[camera]
    x, y = _BORESIGHTS[camera]
    return (
        _high(
            40 + camera, f"DetectionThreshold{number}", f"threshold of camera {number}, {name}"
        ).of(u8("Threshold", "a pixel at or above it is bright", "DN", reset=_THRESHOLDS[camera])),
        _high(
            42 + 2 * camera,
            f"AutoAdjust{number}",
            f"automatic exposure and gain of camera {number}, {name}",
        ).of(u8("Enabled", "1: the camera adjusts itself", high=1)),
        _high(43 + 2 * camera, f"CameraSettings{number}", f"set-up of camera {number}, {name}").of(
            u16("Exposure", "in two lines, 127 us; at most 255 are used", reset=_EXPOSURES[camera]),
            u8("Gain", "amplification; the camera gets at most 63"),
            u8("BlueGain", "gain of the blue channel", reset=0x80),
            u8("RedGain", "gain of the red channel", reset=0x80),
        ),
        _low(50 + camera, f"Boresight{number}", f"optical axis of camera {number}, {name}").of(
            u16("X", "column", "px", 100, high=codes.COLUMNS - 1, reset=x),
            u16("Y", "row", "px", 100, high=codes.ROWS - 1, reset=y),
        ),
        _low(
            52 + camera,
            f"Mask{number}",
            f"area that detection ignores, camera {number}; ends included, all 0: none",
        ).of(
            u8("Area", "number of the area", reset=1).within(1, codes.MASK_AREAS),
            u16("XMin", "first column", "px", high=codes.COLUMNS - 1),
            u16("XMax", "last column", "px", high=codes.COLUMNS - 1),
            u16("YMin", "first row", "px", high=codes.ROWS - 1),
            u16("YMax", "last row", "px", high=codes.ROWS - 1),
            ordered=(("XMin", "XMax"), ("YMin", "YMax")),
        ),
        _low(
            54 + camera,
            f"Distortion{number}",
            f"distorted radius as a polynomial of the undistorted one in px, camera {number}",
        ).of(*_coefficients()),
    )


def _coefficients() -> Iterator[Field]:
    for power, value in enumerate(DISTORTION):
        mantissa, exponent = codes.split_coefficient(value)
        meaning = f"of the factor of r_u^{power}; signed is assumed"
        yield i16(f"Mantissa{power}", meaning, reset=mantissa)
        yield u8(f"Exponent{power}", "negative power of ten; assumed", reset=exponent)


_COMMON = (
    _high(0, "Reset", "restart a part of the node", risk="that part restarts").of(
        u8("Target", "part", choices=codes.ResetTarget, reset=codes.ResetTarget.COMMUNICATION)
    ),
    _low(
        11,
        "ClearOverCurrent",
        "clear over-current flags of the memories, and switch those on again",
    ).of(u8("Selection", "which memories", choices=codes.SramSelection)),
    _high(
        20, "CaptureAndDetect", "capture an image and measure; results become pending at once"
    ).of(_CAMERA, _TO_SRAM),
    _medium(21, "CaptureOnly", "capture an image; the capture result becomes pending at once").of(
        _CAMERA, _TO_SRAM, _LOCATION
    ),
    _high(64, "StartImageDownload", "select an image and its size, and prepare frame 0").of(
        u8("Sram", "memory that is read", choices=codes.Sram),
        _LOCATION,
        u8("Size", "side of the square", choices=codes.ImageSize),
    ),
    _high(65, "NextImageFrame", "prepare a frame of the image that StartImageDownload selected").of(
        u16(
            "Frame",
            "number from 0, row by row; must exist in the selected size",
            high=codes.ImageSize.SIDE_1024.frames - 1,
        )
    ),
    Message(100, "SetNadirSearch", "search method for the nadir camera's edges", extension=True).of(
        u8("Search", "method", choices=codes.NadirSearch)
    ),
    *SET_SWITCHES,
)

TELECOMMANDS = tuple(
    sorted(
        (*_COMMON, *_of_camera(codes.Camera.SUN), *_of_camera(codes.Camera.NADIR)),
        key=lambda message: message.id,
    )
)

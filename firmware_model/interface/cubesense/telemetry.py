"""CubeSense's telemetry, with the extensions that are ours.

CubeSpace family of nodes with two cameras, interface generation 2: IDs, lengths and layouts as
hosts use them; names are ours. IDs are as on the wire, bit 7 set. Unlike CubeStar's, the uptime of
Identification has seconds before milliseconds.
"""

from collections.abc import Mapping

from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.message import TELEMETRY_BIT, Confidence, Message
from cubestack.firmware_model.interface.codec.node_codes import AckError
from cubestack.firmware_model.interface.cubesense.codes import (
    COLUMNS,
    EMPTY_FRAME,
    FRAME_BYTES,
    LARGEST_ANGLE_DEG,
    MASK_AREAS,
    ROWS,
    Camera,
    CaptureResult,
    DetectResult,
    Sram,
)
from cubestack.firmware_model.interface.cubesense.extensions import EXTENSIONS

__all__ = ["RESULTS", "SCHEDULES", "TELEMETRIES"]

_HIGH, _MEDIUM, _LOW = Confidence.HIGH, Confidence.MEDIUM, Confidence.LOW

#: ID of a camera's result.
RESULTS: Mapping[Camera, int] = {
    Camera.SUN: TELEMETRY_BIT + 20,
    Camera.NADIR: TELEMETRY_BIT + 21,
}

#: ID of a result that, once it is read, makes the node capture and detect again: with which camera
#: (whose result it is) and into which memory.
SCHEDULES: Mapping[int, tuple[Camera, Sram]] = {
    TELEMETRY_BIT + 22: (Camera.SUN, Sram.SRAM1),
    TELEMETRY_BIT + 23: (Camera.NADIR, Sram.SRAM2),
    TELEMETRY_BIT + 24: (Camera.SUN, Sram.SRAM2),
    TELEMETRY_BIT + 25: (Camera.NADIR, Sram.SRAM1),
}


def _angle(name: str, start: int, meaning: str) -> Field:
    limit = LARGEST_ANGLE_DEG
    return Field(name, "i16", start, meaning, "deg", 100, None, -limit, limit)


def _result_fields() -> tuple[Field, ...]:
    return (
        _angle("Alpha", 0, "angle along the rows, x to the right"),
        _angle("Beta", 16, "angle along the columns, y downwards"),
        Field("Capture", "u8", 32, "what became of the capture", choices=CaptureResult),
        Field(
            "Detect",
            "u8",
            40,
            "what became of the detection; angles count with SUCCESS only",
            choices=DetectResult,
        ),
    )


def _result(camera: Camera) -> Message:
    return Message(
        RESULTS[camera],
        f"Result{camera + 1}",
        6,
        f"latest measurement of camera {camera + 1}",
        _result_fields(),
        confidence=_MEDIUM,
    )


def _schedule(identifier: int, camera: Camera, sram: Sram) -> Message:
    return Message(
        identifier,
        f"Result{camera + 1}ThenSram{sram + 1}",
        6,
        f"latest measurement of camera {camera + 1}; starts its next one, into SRAM{sram + 1}",
        _result_fields(),
        confidence=_HIGH,
    )


def _configuration_fields() -> tuple[Field, ...]:
    fields = [
        Field(f"Threshold{camera + 1}", "u8", 8 * camera, "detection threshold", "DN")
        for camera in Camera
    ]
    for camera in Camera:
        start = 16 + 48 * camera
        number = camera + 1
        fields += [
            Field(f"AutoAdjust{number}", "u8", start, "1: the camera adjusts itself"),
            Field(f"Exposure{number}", "u16", start + 8, "as it was sent"),
            Field(f"Gain{number}", "u8", start + 24, "as it was sent"),
            Field(f"BlueGain{number}", "u8", start + 32, "as it was sent"),
            Field(f"RedGain{number}", "u8", start + 40, "as it was sent"),
        ]
    return tuple(fields)


def _mask(camera: Camera) -> Message:
    limits = (("XMin", COLUMNS), ("XMax", COLUMNS), ("YMin", ROWS), ("YMax", ROWS))
    return Message(
        TELEMETRY_BIT + 72 + camera,
        f"Masks{camera + 1}",
        8 * MASK_AREAS,
        f"areas that detection ignores, camera {camera + 1}; ends included, all 0: none",
        tuple(
            Field(
                f"{name}{area + 1}",
                "u16",
                64 * area + 16 * index,
                f"{'first' if name.endswith('Min') else 'last'} "
                f"{'column' if name.startswith('X') else 'row'} of area {area + 1}",
                "px",
                maximum=size - 1,
            )
            for area in range(MASK_AREAS)
            for index, (name, size) in enumerate(limits)
        ),
        confidence=_MEDIUM,
    )


_NODE = (
    Message(
        TELEMETRY_BIT,
        "Identification",
        8,
        "what the node is, and its uptime",
        (
            Field("NodeType", "u8", 0, "type of node"),
            Field("InterfaceVersion", "u8", 8, "version of this interface"),
            Field("FirmwareVersionMajor", "u8", 16, "firmware version, major"),
            Field("FirmwareVersionMinor", "u8", 24, "firmware version, minor"),
            Field("RuntimeSeconds", "u16", 32, "uptime, whole seconds", "s"),
            Field("RuntimeMilliseconds", "u16", 48, "uptime, part below one second", "ms"),
        ),
        confidence=_HIGH,
    ),
    Message(
        TELEMETRY_BIT + 1,
        "SerialNumber",
        6,
        "serial number",
        (Field("SerialNumber", "bytes6", 0, "ASCII; zero behind a shorter one"),),
        confidence=_LOW,
    ),
    Message(
        TELEMETRY_BIT + 2,
        "CommunicationStatus",
        8,
        "counters and error flags of the host's buses",
        (
            Field("TcmdCount", "u16", 0, "telecommands received"),
            Field("TlmCount", "u16", 16, "telemetry requests received"),
            Field("TcmdBufferOverrun", "u8", 32, "1: a telecommand met a full buffer"),
            Field("I2cTlmReadError", "u8", 40, "1: read with no telemetry ID written before"),
            Field("UartProtocolError", "u8", 48, "1: byte outside of a frame, or unknown escape"),
            Field("UartMsgIncomplete", "u8", 56, "1: frame that never ended"),
        ),
        confidence=_LOW,
    ),
    Message(
        TELEMETRY_BIT + 3,
        "TcmdProcessed",
        3,
        "acknowledge of the last telecommand",
        (
            Field("LastTcmd", "u8", 0, "its ID"),
            Field("Processed", "u8", 8, "1: processed, 0: not yet", reset=1),
            Field("Error", "u8", 16, "its error code, as in the acknowledge", choices=AckError),
        ),
        confidence=_HIGH,
    ),
)

_STATE = (
    Message(
        TELEMETRY_BIT + 26,
        "Power",
        10,
        "supply currents, and memories that drew too much",
        (
            Field("Current3V3", "u16", 0, "of the 3.3 V supply", "mA", 10),
            Field("CurrentSram1", "u16", 16, "of SRAM1", "mA", 10),
            Field("CurrentSram2", "u16", 32, "of SRAM2", "mA", 10),
            Field("Current5V", "u16", 48, "of the 5 V supply", "mA", 10),
            Field("OverCurrent1", "u8", 64, "1: SRAM1 drew too much since the flag was cleared"),
            Field("OverCurrent2", "u8", 72, "1: SRAM2 drew too much since the flag was cleared"),
        ),
        confidence=_HIGH,
    ),
    Message(
        TELEMETRY_BIT + 40,
        "Configuration",
        14,
        "thresholds and camera settings",
        _configuration_fields(),
        confidence=_HIGH,
    ),
    Message(
        TELEMETRY_BIT + 64,
        "ImageFrame",
        FRAME_BYTES,
        "the frame that is ready",
        (Field("Frame", f"bytes{FRAME_BYTES}", 0, "pixels, row after row"),),
        confidence=_HIGH,
    ),
    Message(
        TELEMETRY_BIT + 65,
        "ImageFrameInfo",
        3,
        "which frame is ready",
        (
            Field("FrameNumber", "u16", 0, "65535 (ours): none is ready yet", reset=EMPTY_FRAME),
            Field("Checksum", "u8", 16, "exclusive or of the frame's bytes (ours)"),
        ),
        confidence=_HIGH,
    ),
    *(_mask(camera) for camera in Camera),
)

TELEMETRIES = (
    *_NODE,
    *(_result(camera) for camera in Camera),
    *(_schedule(identifier, *target) for identifier, target in SCHEDULES.items()),
    *_STATE,
    *EXTENSIONS,
)

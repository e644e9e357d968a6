"""CubeSense's telemetry, with the extensions.

CubeSpace family of nodes with two cameras, interface generation 2: IDs, lengths and layouts as
hosts use them; names are assumed. IDs are as on the wire, bit 7 set. Unlike CubeStar's, the uptime
of Identification has seconds before milliseconds.
"""

from collections.abc import Iterator, Mapping
from functools import partial

from cubestack.firmware_model.interface.codec.field import Field, byte_array, i16, u8, u16
from cubestack.firmware_model.interface.codec.message import Confidence, Message
from cubestack.firmware_model.interface.codec.node_messages import IDENTIFICATION, AckError
from cubestack.firmware_model.interface.cubesense import codes
from cubestack.firmware_model.interface.cubesense.extensions import EXTENSIONS

_high = partial(Message, confidence=Confidence.HIGH)
_medium = partial(Message, confidence=Confidence.MEDIUM)
_low = partial(Message, confidence=Confidence.LOW)

#: ID of a camera's result.
RESULTS: Mapping[codes.Camera, int] = {codes.Camera.SUN: 148, codes.Camera.NADIR: 149}

#: Results whose read makes the node capture and detect again: camera (of the result and the new
#: capture) and memory of the capture, by ID.
SCHEDULES: Mapping[int, tuple[codes.Camera, codes.Sram]] = {
    150: (codes.Camera.SUN, codes.Sram.SRAM1),
    151: (codes.Camera.NADIR, codes.Sram.SRAM2),
    152: (codes.Camera.SUN, codes.Sram.SRAM2),
    153: (codes.Camera.NADIR, codes.Sram.SRAM1),
}


def _angle(name: str, meaning: str) -> Field:
    return i16(name, meaning, "deg", 100).within(-codes.LARGEST_ANGLE_DEG, codes.LARGEST_ANGLE_DEG)


#: Fields of every result.
_RESULT = (
    _angle("Alpha", "angle along the rows, x to the right"),
    _angle("Beta", "angle along the columns, y downwards"),
    u8("Capture", "outcome of the capture", choices=codes.CaptureResult),
    u8("Detect", "outcome; angles are valid with SUCCESS only", choices=codes.DetectResult),
)


def _configuration_fields() -> Iterator[Field]:
    for camera in codes.Camera:
        yield u8(f"Threshold{camera + 1}", "detection threshold", "DN")
    for camera in codes.Camera:
        yield u8(f"AutoAdjust{camera + 1}", "1: the camera adjusts itself")
        yield u16(f"Exposure{camera + 1}", "as it was sent")
        for name in ("Gain", "BlueGain", "RedGain"):
            yield u8(f"{name}{camera + 1}", "as it was sent")


def _mask(camera: codes.Camera) -> Message:
    limits = (
        ("XMin", "first column", codes.COLUMNS),
        ("XMax", "last column", codes.COLUMNS),
        ("YMin", "first row", codes.ROWS),
        ("YMax", "last row", codes.ROWS),
    )
    return _medium(
        200 + camera,
        f"Masks{camera + 1}",
        f"areas that detection ignores, camera {camera + 1}; ends included, all 0: none",
    ).of(
        *(
            u16(f"{name}{area}", f"{what} of area {area}", "px", high=size - 1)
            for area in range(1, codes.MASK_AREAS + 1)
            for name, what, size in limits
        )
    )


_NODE = (
    _high(128, "Identification", IDENTIFICATION.meaning).of(
        *IDENTIFICATION.fields[:4], *reversed(IDENTIFICATION.fields[4:])
    ),
    _low(129, "SerialNumber", "serial number").of(
        byte_array(6, "SerialNumber", "ASCII; padded with zeros")
    ),
    _low(130, "CommunicationStatus", "counters and error flags of the host's buses").of(
        u16("TcmdCount", "telecommands received", counter=True),
        u16("TlmCount", "telemetry requests received", counter=True),
        u8("TcmdBufferOverrun", "1: telecommand while the buffer was full"),
        u8("I2cTlmReadError", "1: read with no telemetry ID written before"),
        u8("UartProtocolError", "1: byte outside of a frame, or unknown escape"),
        u8("UartMsgIncomplete", "1: frame that never ended"),
    ),
    _high(131, "TcmdProcessed", "acknowledge of the last telecommand").of(
        u8("LastTcmd", "its ID"),
        u8("Processed", "1: processed, 0: not yet", reset=1),
        u8("Error", "its error code, as in the acknowledge", choices=AckError),
    ),
)

_STATE = (
    _high(154, "Power", "supply currents and over-currents").of(
        u16("Current3V3", "of the 3.3 V supply", "mA", 10),
        u16("CurrentSram1", "of SRAM1", "mA", 10),
        u16("CurrentSram2", "of SRAM2", "mA", 10),
        u16("Current5V", "of the 5 V supply", "mA", 10),
        u8("OverCurrent1", "1: over-current of SRAM1 since the flag was cleared"),
        u8("OverCurrent2", "1: over-current of SRAM2 since the flag was cleared"),
    ),
    _high(168, "Configuration", "thresholds and camera settings").of(*_configuration_fields()),
    _high(192, "ImageFrame", "the ready frame").of(
        byte_array(codes.FRAME_BYTES, "Frame", "pixels, row by row")
    ),
    _high(193, "ImageFrameInfo", "number and checksum of the ready frame").of(
        u16("FrameNumber", "65535 (assumed): none is ready yet", reset=codes.EMPTY_FRAME),
        u8("Checksum", "exclusive or of the frame's bytes (assumed)"),
    ),
    *(_mask(camera) for camera in codes.Camera),
)

TELEMETRIES = (
    *_NODE,
    *(
        _medium(identifier, f"Result{camera + 1}", f"latest measurement of camera {camera + 1}").of(
            *_RESULT
        )
        for camera, identifier in RESULTS.items()
    ),
    *(
        _high(
            identifier,
            f"Result{camera + 1}ThenSram{sram + 1}",
            f"latest measurement of camera {camera + 1}; starts its next one, into SRAM{sram + 1}",
            starts_measurement=True,
        ).of(*_RESULT)
        for identifier, (camera, sram) in SCHEDULES.items()
    ),
    *_STATE,
    *EXTENSIONS,
)

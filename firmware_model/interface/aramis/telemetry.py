"""AraMiS' telemetry: the answers of the thesis' use cases, then reports.

AraMiS thesis, section 2.2: an attitude quaternion with the time of its picture, or the reason why
there is none. IDs and layouts are ours; those from 200 on have no use case behind them.
"""

from dataclasses import replace

from cubestack.firmware_model.interface.aramis.codes import (
    AckError,
    CatalogueState,
    MeasurementMode,
    MeasurementOutcome,
    OnOff,
    Reason,
    ResetCause,
    SensorState,
)
from cubestack.firmware_model.interface.aramis.flags import FLAG_BYTES, flag_fields
from cubestack.firmware_model.interface.aramis.telecommands import (
    BLOCK_BYTES,
    TELECOMMANDS,
)
from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.message import Message

__all__ = ["PHASES", "SETTINGS_SHOWN", "TELEMETRY"]

#: Steps of a measurement, in the order of telemetry PhaseTimes, with their meanings.
PHASES = {
    "Setup": "setting the camera up",
    "Capture": "waiting for the frame and taking it, which the processor need not attend",
    "Check": "the catalogue's checksum in RAM",
    "Threshold": "mean and noise of the last five pictures, mask of the bright pixels",
    "Spikes": "removing spikes from the mask",
    "Centroids": "regions and their centroids",
    "Faces": "faces of the sphere around the rough direction",
    "Triangles": "areas and moments of measured triangles",
    "Search": "candidates by the k-vectors",
    "Pivoting": "candidates that share two stars",
    "Identities": "which star of the triangle is which",
    "Attitude": "QUEST",
    "Verification": "confirmation by further stars",
    "Total": "from the request to the result",
}


def _quaternion(meaning: str) -> tuple[Field, ...]:
    return tuple(
        Field(f"Q{index}", "f32", 32 * index, f"{name} part, {meaning}")
        for index, name in enumerate(("x", "y", "z", "scalar"))
    )


def _time(offset: int, what: str) -> tuple[Field, ...]:
    return (
        Field("JulianDay", "u32", offset, f"{what}: whole Julian days; 0 while not set", "d"),
        Field("Millisecond", "u32", offset + 32, f"{what}: since that noon UT", "ms"),
    )


_NODE = (
    Message(
        128,
        "Identification",
        8,
        "who answers",
        (
            Field("NodeType", "u8", 0, "6: AraMiS star tracker"),
            Field("InterfaceVersion", "u8", 8, "of these tables"),
            Field("FirmwareVersionMajor", "u8", 16, "of the program"),
            Field("FirmwareVersionMinor", "u8", 24, "of the program"),
            Field("RuntimeMilliseconds", "u16", 32, "fraction of RuntimeSeconds", "ms"),
            Field("RuntimeSeconds", "u16", 48, "since power-up, wraps", "s"),
        ),
    ),
    Message(
        129,
        "ExtendedIdentification",
        7,
        "the unit and its traffic",
        (
            Field("SerialNumber", "u16", 0, "of the unit"),
            Field("ResetCause", "enum8", 16, "why the program started", choices=ResetCause),
            Field("TcmdCount", "u16", 24, "accepted telecommands, wraps"),
            Field("TlmCount", "u16", 40, "answered telemetry, wraps"),
        ),
    ),
    Message(130, "ErrorFlags", FLAG_BYTES, "what went wrong since ClearErrorFlags", flag_fields()),
    Message(
        131,
        "TcmdProcessed",
        4,
        "whether every accepted telecommand is done, and the acknowledge of the latest one",
        (
            Field("Processed", "u8", 0, "1: all are done"),
            Field("Waiting", "u8", 8, "telecommands that wait"),
            Field("Latest", "u8", 16, "ID of the latest telecommand, accepted or not"),
            Field("Error", "enum8", 24, "its error code", choices=AckError),
        ),
    ),
    Message(
        132,
        "SensorStatus",
        5,
        "what the star tracker does",
        (
            Field("State", "enum8", 0, "state", choices=SensorState),
            Field("Catalogue", "enum8", 8, "its catalogue", choices=CatalogueState),
            Field("CameraSupply", "enum8", 16, "switch of the camera unit", choices=OnOff),
            Field("Loop", "enum8", 24, "measuring again and again", choices=OnOff),
            Field("TimeSet", "u8", 32, "1: the clock was set"),
        ),
    ),
    Message(
        133,
        "SystemTime",
        12,
        "the clock",
        (*_time(0, "now"), Field("Uptime", "u32", 64, "since power-up, wraps", "ms")),
    ),
)

_RESULTS = (
    Message(
        134,
        "Attitude",
        38,
        "the latest attitude, and how the latest measurement ended",
        (
            *_quaternion("v_camera = q v_inertial q*"),
            *_time(128, "mid-exposure of the latest measurement's picture"),
            Field("ImageUptime", "u32", 192, "the same since power-up, wraps", "ms"),
            Field("FrameCounter", "u32", 224, "number of that picture since power-up"),
            Field("Outcome", "enum8", 256, "outcome", choices=MeasurementOutcome),
            Field("Reason", "enum8", 264, "why", choices=Reason),
            Field("Mode", "enum8", 272, "mode", choices=MeasurementMode),
            Field("Valid", "u8", 280, "1: that picture gave the quaternion, else an older one"),
            Field("Matched", "u8", 288, "stars that the quaternion rests on"),
            Field("Detected", "u8", 296, "stars in the picture"),
        ),
    ),
    Message(
        135,
        "BodyAttitude",
        26,
        "the latest attitude of the spacecraft",
        (
            *_quaternion("v_body = q v_inertial q*"),
            *_time(128, "mid-exposure of the latest measurement's picture"),
            Field("Reason", "enum8", 192, "why", choices=Reason),
            Field("Valid", "u8", 200, "as in Attitude"),
        ),
    ),
    Message(
        136,
        "Boresight",
        9,
        "direction of the latest attitude",
        (
            Field("RightAscension", "f32", 0, "of the boresight, -pi to pi", "rad"),
            Field("Declination", "f32", 32, "of the boresight", "rad"),
            Field("Valid", "u8", 64, "as in Attitude"),
        ),
    ),
)

_REPORTS = (
    Message(
        200,
        "PhaseTimes",
        4 * len(PHASES),
        "time of each step of the latest measurement",
        tuple(
            Field(name, "u32", 32 * index, meaning, "us")
            for index, (name, meaning) in enumerate(PHASES.items())
        ),
    ),
    Message(
        201,
        "CatalogueStatus",
        35,
        "the catalogue and its errors",
        (
            Field("State", "enum8", 0, "state", choices=CatalogueState),
            Field("Stars", "u16", 8, "in the catalogue"),
            Field("Triangles", "u32", 24, "in the catalogue"),
            Field("Bytes", "u32", 56, "of its image", "bytes"),
            Field("FieldOfView", "f32", 88, "longest side of a triangle", "deg"),
            Field("Epoch", "f32", 120, "Julian year of its directions"),
            Field("Loads", "u16", 152, "from flash since power-up"),
            Field("Failures", "u16", 168, "of them without a good catalogue"),
            Field("Corrected", "u16", 184, "words corrected in the latest one"),
            Field("Lost", "u16", 200, "words with more than one wrong bit in the latest one"),
            Field("CorrectedTotal", "u32", 216, "words corrected since power-up"),
            Field("RamErrors", "u16", 248, "times that RAM was found damaged"),
            Field("LoadTime", "u16", 264, "of the latest one", "ms"),
        ),
    ),
    Message(
        202,
        "UploadStatus",
        6,
        "loading a catalogue",
        (
            Field("Blocks", "u16", 0, "that the image has"),
            Field("BlocksReceived", "u16", 16, "different ones since BeginCatalogue"),
            Field("NextBlock", "u16", 32, "first one that is missing"),
        ),
    ),
    Message(
        203,
        "ImageBlock",
        BLOCK_BYTES,
        "the block that ImageBlockSet selected",
        (Field("Block", f"bytes{BLOCK_BYTES}", 0, "pixels, row after row"),),
    ),
    Message(
        204,
        "CameraRegister",
        4,
        "the register that SelectCameraRegister read",
        (
            Field("Address", "u8", 0, "register's address"),
            Field("Value", "u16", 8, "its value"),
            Field("Valid", "u8", 24, "1: the sensor answered"),
        ),
    ),
    Message(
        205,
        "LoopStatus",
        9,
        "measuring again and again",
        (
            Field("Running", "enum8", 0, "the loop", choices=OnOff),
            Field("Period", "u16", 8, "of the loop", "ms"),
            Field("Iterations", "u32", 24, "since power-up"),
            Field("LateIterations", "u16", 56, "that began more than 10 ms after their time"),
        ),
    ),
    Message(
        206,
        "DetectionSummary",
        4,
        "the latest picture",
        (
            Field("Detected", "u8", 0, "stars"),
            Field("Mean", "u8", 8, "level of the last five pictures", "DN"),
            Field("Threshold", "u8", 16, "pixels above it are bright", "DN"),
            Field("Pictures", "u8", 24, "that mean and threshold rest on"),
        ),
    ),
    Message(
        207,
        "IdentificationSummary",
        7,
        "the latest identification",
        (
            Field("Candidates", "u16", 0, "triangles left when matching ended"),
            Field("Pivots", "u8", 16, "pivot triangles of the last triple"),
            Field("Triples", "u16", 24, "triples of stars tried"),
            Field("Expected", "u8", 40, "catalogue stars in the field; 0 without verification"),
            Field("Matched", "u8", 48, "stars identified"),
        ),
    ),
    Message(
        208,
        "StarDetails",
        18,
        "a star of the latest picture, the brightest first",
        (
            Field("StarNumber", "u8", 0, "from 0"),
            Field("X", "f32", 8, "centroid's column; 0 is the middle of the first pixel", "px"),
            Field("Y", "f32", 40, "centroid's row", "px"),
            Field("Brightness", "f32", 72, "sum of its grey levels", "DN"),
            Field("Identified", "u8", 104, "1: Hipparcos says which star it is"),
            Field("Hipparcos", "u32", 112, "its number in the catalogue"),
        ),
        steps=True,
    ),
    Message(
        209,
        "SupplyStatus",
        3,
        "the camera unit's supply; whoever asks decides what a latch-up is",
        (
            Field("Switch", "enum8", 0, "switch", choices=OnOff),
            Field("Current", "u16", 8, "present current", "mA", scale=10),
        ),
    ),
)

#: Telemetry frame of each setting telecommand, which shows its parameters: ID and name.
_SHOWN = {
    "SetExposure": (220, "Exposure"),
    "SetGain": (221, "Gain"),
    "SetDetection": (222, "DetectionSettings"),
    "SetIdentification": (223, "IdentificationSettings"),
    "SetField": (224, "FieldSettings"),
    "SetReloadPeriod": (225, "ReloadSettings"),
    "SetBodyRotation": (226, "BodyRotation"),
    "StartLoop": (227, "LoopSettings"),
    "ImageBlockSet": (228, "ImageBlockSettings"),
}

#: Telemetry frame to the setting telecommand whose parameters it shows.
SETTINGS_SHOWN = {name: command for command, (_, name) in _SHOWN.items()}


def _setting(command: Message) -> Message:
    number, name = _SHOWN[command.name]
    return Message(
        number,
        name,
        command.length,
        f"parameters of telecommand {command.name}",
        command.fields,
        ours=True,
    )


TELEMETRY = (
    *_NODE,
    *_RESULTS,
    *(replace(message, ours=True) for message in _REPORTS),
    *sorted(
        (_setting(command) for command in TELECOMMANDS if command.name in _SHOWN),
        key=lambda message: message.id,
    ),
)

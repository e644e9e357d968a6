"""AraMiS' telemetry: the answers of the thesis' use cases, then reports.

AraMiS thesis, section 2.2: an attitude quaternion with the time of its image, or the reason why
there is none. IDs and layouts are assumed; no use case covers those from 200 on.
"""

from dataclasses import replace

from cubestack.firmware_model.interface.aramis import codes
from cubestack.firmware_model.interface.aramis.telecommands import (
    BLOCK_BYTES,
    SWITCHES_SHOWN,
    TELECOMMANDS,
)
from cubestack.firmware_model.interface.codec.attitude_quality import ATTITUDE_QUALITY
from cubestack.firmware_model.interface.codec.field import (
    Field,
    Flag,
    Severity,
    byte_array,
    enum8,
    f32,
    flags_at,
    u8,
    u16,
    u32,
)
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.codec.node_messages import IDENTIFICATION, TCMD_PROCESSED

#: Error flags, all assumed: bit and cause by name.
_FLAGS = {
    "UartProtocolError": (0, "byte outside of a frame, or an unknown escape"),
    "UartIncomplete": (1, "frame that never ended"),
    "UartTimeout": (2, "silence inside a frame"),
    "I2cReadWithoutId": (3, "read with no telemetry ID written before"),
    "TcmdBufferOverflow": (4, "telecommand while the command buffer was full"),
    "TcmdIdError": (5, "unknown telecommand ID"),
    "TcmdLengthError": (6, "telecommand with too few or too many parameter bytes"),
    "TlmIdError": (7, "unknown telemetry ID"),
    "ParameterError": (8, "parameter out of range, without a specific flag"),
    "DirectionError": (9, "rough direction out of range, or not a unit vector"),
    "RotationError": (10, "body rotation whose length is not 1"),
    "NotActive": (11, "measurement requested while the star tracker is not active"),
    "TimingError": (12, "an iteration of the loop began late"),
    "CameraSilent": (16, "the camera did not acknowledge on its control bus"),
    "CameraTimeout": (17, "no whole frame came in time"),
    "CameraFrameError": (18, "a frame or its lines were longer or shorter than programmed"),
    "CameraOff": (19, "an image was requested while the camera's supply was off"),
    "CatalogueMissing": (24, "the flash holds no catalogue"),
    "CatalogueDamaged": (25, "a word of the catalogue had more than one wrong bit"),
    "CatalogueCorrected": (26, "words of the catalogue were corrected on loading"),
    "RamError": (27, "the catalogue in RAM was damaged, and mended or reloaded"),
    "UploadError": (28, "catalogue with a wrong length, checksum or contents, or a stray block"),
    "ConfigError": (29, "settings in flash were damaged; reset values are in use"),
}

_GROUPS = {
    0: "UART",
    3: "I2C",
    4: "requests",
    12: "loop",
    16: "camera",
    24: "catalogue",
    29: "flash",
}
"""What the flags from a bit on are about."""

_FAULTS = {
    *("CameraSilent", "CameraTimeout", "CameraFrameError"),
    *("CatalogueMissing", "CatalogueDamaged", "RamError", "ConfigError"),
}

FLAG_NAMES = frozenset(_FLAGS)


def flag_fields() -> tuple[Field, ...]:
    return flags_at(
        Flag(bit, name, cause, _group(bit), Severity.FAULT if name in _FAULTS else Severity.NOTICE)
        for name, (bit, cause) in _FLAGS.items()
    )


def _group(bit: int) -> str:
    return next(_GROUPS[first] for first in reversed(_GROUPS) if first <= bit)


#: Steps of a measurement, in the order of telemetry PhaseTimes, with their meanings.
PHASES = {
    "Setup": "setting up the camera",
    "Capture": "waiting for the frame and its transfer by DMA",
    "Check": "the catalogue in RAM checked",
    "Threshold": "mean and noise of the last five images, mask of the bright pixels",
    "Spikes": "removing spikes from the mask",
    "Centroids": "regions and their centroids",
    "Faces": "faces of the sphere around the rough direction",
    "Triangles": "areas and moments of measured triangles",
    "Search": "candidates by the k-vectors",
    "Pivoting": "candidates that share two stars",
    "Identities": "assigning the stars of the triangle",
    "Attitude": "QUEST",
    "Verification": "confirmation by further stars",
    "Total": "from the request to the result",
}


def _quaternion(meaning: str) -> tuple[Field, ...]:
    return tuple(
        f32(f"Q{index}", f"{name} part, {meaning}")
        for index, name in enumerate(("x", "y", "z", "scalar"))
    )


def _time(what: str) -> tuple[Field, ...]:
    return (
        u32("JulianDay", f"{what}: whole Julian days; 0 while not set", "d"),
        u32("Millisecond", f"{what}: since that noon UT", "ms"),
    )


_NODE = (
    IDENTIFICATION,
    Message(129, "ExtendedIdentification", "the unit and its traffic").of(
        u16("SerialNumber", "of the unit"),
        enum8("ResetCause", "why the program started", choices=codes.ResetCause),
        u16("TcmdCount", "accepted telecommands, wraps", counter=True),
        u16("TlmCount", "answered telemetry, wraps", counter=True),
    ),
    Message(130, "ErrorFlags", "errors since ClearErrorFlags").of(*flag_fields()),
    TCMD_PROCESSED,
    Message(132, "SensorStatus", "state of the star tracker").of(
        enum8("State", "state", choices=codes.SensorState),
        enum8("Catalogue", "its catalogue", choices=codes.CatalogueState),
        enum8("CameraSupply", "switch of the camera unit", choices=codes.OnOff),
        enum8("Loop", "periodic measurement", choices=codes.OnOff),
        u8("TimeSet", "1: the clock was set"),
    ),
    Message(133, "SystemTime", "the clock").of(
        *_time("now"), u32("Uptime", "since power-up, wraps", "ms")
    ),
)

_RESULTS = (
    Message(134, "Attitude", "the latest attitude, and how the latest measurement ended").of(
        *_quaternion("v_camera = q v_inertial q*"),
        *_time("mid-exposure of the latest measurement's image"),
        u32("ImageUptime", "the same since power-up, wraps", "ms"),
        u32("FrameCounter", "number of that image since power-up", counter=True),
        enum8("Outcome", "outcome", choices=codes.MeasurementOutcome),
        enum8("Reason", "why", choices=codes.Reason),
        enum8("Mode", "mode", choices=codes.MeasurementMode),
        u8("Valid", "1: the quaternion is from that image, else from an older one"),
        u8("Matched", "stars used for the quaternion"),
        u8("Detected", "stars in the image"),
    ),
    Message(135, "BodyAttitude", "the latest attitude of the spacecraft").of(
        *_quaternion("v_body = q v_inertial q*"),
        *_time("mid-exposure of the latest measurement's image"),
        enum8("Reason", "why", choices=codes.Reason),
        u8("Valid", "as in Attitude"),
    ),
    Message(136, "Boresight", "direction of the latest attitude").of(
        f32("RightAscension", "of the boresight, -pi to pi", "rad"),
        f32("Declination", "of the boresight", "rad"),
        u8("Valid", "as in Attitude"),
    ),
)

_REPORTS = (
    Message(200, "PhaseTimes", "time of each step of the latest measurement").of(
        *(u32(name, meaning, "us") for name, meaning in PHASES.items())
    ),
    Message(201, "CatalogueStatus", "the catalogue and its errors").of(
        enum8("State", "state", choices=codes.CatalogueState),
        u16("Stars", "in the catalogue"),
        u32("Triangles", "in the catalogue"),
        u32("Bytes", "of its image", "bytes"),
        f32("FieldOfView", "longest side of a triangle", "deg"),
        f32("Epoch", "Julian year of its directions"),
        u16("Loads", "from flash since power-up", counter=True),
        u16("Failures", "of them without a good catalogue"),
        u16("Corrected", "words corrected in the latest one"),
        u16("Lost", "words with more than one wrong bit in the latest one"),
        u32("CorrectedTotal", "words corrected since power-up", counter=True),
        u16("RamErrors", "number of times that RAM was damaged", counter=True),
        u16("LoadTime", "of the latest one", "ms"),
    ),
    Message(202, "UploadStatus", "loading a catalogue").of(
        u16("Blocks", "of the image"),
        u16("BlocksReceived", "different blocks since BeginCatalogue", counter=True),
        u16("NextBlock", "first missing block"),
    ),
    Message(203, "ImageBlock", "the block that ImageBlockSet selected").of(
        byte_array(BLOCK_BYTES, "Block", "pixels, row after row")
    ),
    Message(204, "CameraRegister", "the register that SelectCameraRegister read").of(
        u8("Address", "register's address"),
        u16("Value", "its value"),
        u8("Valid", "1: the sensor answered"),
    ),
    Message(205, "LoopStatus", "periodic measurement").of(
        enum8("Running", "the loop", choices=codes.OnOff),
        u16("Period", "of the loop", "ms"),
        u32("Iterations", "since power-up", counter=True),
        u16("LateIterations", "that began more than 10 ms after their time"),
    ),
    Message(206, "DetectionSummary", "the latest image").of(
        u8("Detected", "stars"),
        u8("Mean", "level of the last five images", "DN"),
        u8("Threshold", "pixels above it are bright", "DN"),
        u8("Pictures", "number of images used for mean and threshold"),
    ),
    Message(207, "IdentificationSummary", "the latest identification").of(
        u16("Candidates", "remaining triangles at the end of matching"),
        u8("Pivots", "pivot triangles of the last triple"),
        u16("Triples", "triples of stars tried"),
        u8("Expected", "catalogue stars in the field; 0 without verification"),
        u8("Matched", "stars identified"),
    ),
    Message(208, "StarDetails", "a star of the latest image, the brightest first", steps=True).of(
        u8("StarNumber", "from 0"),
        f32("X", "centroid's column; 0 is the middle of the first pixel", "px"),
        f32("Y", "centroid's row", "px"),
        f32("Brightness", "sum of its grey levels", "DN"),
        u8("Identified", "1: Hipparcos is the star's number"),
        u32("Hipparcos", "its number in the catalogue"),
    ),
    Message(209, "SupplyStatus", "the camera unit's supply; the host detects latch-ups").of(
        enum8("Switch", "switch", choices=codes.OnOff),
        u16("Current", "present current", "mA", scale=10),
    ),
)

_QUALITY = Message(211, "Quality", "quality of the latest attitude and of its image").of(
    u8("Valid", "1: the latest image has an attitude that further stars confirm"),
    enum8("Reason", "why", choices=codes.Reason),
    *ATTITUDE_QUALITY,
    f32("Background", "median level of the sky; 0 with detection=whole-picture", "DN"),
    f32("Noise", "standard deviation of a pixel there", "DN"),
    f32("Spread", "of the level over the field, between its 5th and 95th percentile", "DN"),
    f32("Blind", "fraction of the field that is too bright for stars"),
    u32("Spikes", "bright pixels that belong to no star"),
    u16("Rejected", "bright regions rejected because of their shape"),
)
"""Not in the thesis: filled with `belief=confirmed`, from Background on with `detection=local`."""

#: ID and name of the telemetry frame that shows a setting telecommand's parameters.
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

#: The setting telecommand whose parameters a telemetry frame shows.
SETTINGS_SHOWN = {name: command for command, (_, name) in _SHOWN.items()}


def _setting(command: Message) -> Message:
    number, name = _SHOWN[command.name]
    return Message(number, name, f"parameters of telecommand {command.name}", extension=True).of(
        *command.fields
    )


TELEMETRY = (
    *_NODE,
    *_RESULTS,
    *(replace(message, extension=True) for message in _REPORTS),
    SWITCHES_SHOWN,
    replace(_QUALITY, extension=True),
    *sorted(
        (_setting(command) for command in TELECOMMANDS if command.name in _SHOWN),
        key=lambda message: message.id,
    ),
)

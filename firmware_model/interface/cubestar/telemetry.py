"""CubeStar's published telemetry, first part: the node, its supply, camera, and settings.

CubeSpace family of nodes, interface version 3: IDs, names and layouts. Units are ours where the
tables print none: times in ms, currents in 0.1 mA. IDs are as on the wire, bit 7 set.
"""

from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS
from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.cubestar.codes import (
    IdMode,
    MemoryTest,
    ResetCause,
    SwitchState,
    TaskStatus,
)
from cubestack.firmware_model.interface.cubestar.flags import FLAG_BYTES, flag_fields

__all__ = ["NODE_TELEMETRY", "times"]


def times(*names_and_meanings: tuple[str, str], start: int = 0) -> tuple[Field, ...]:
    """u16 fields in ms, one after the other from bit ``start`` on."""
    return tuple(
        Field(name, "u16", start + 16 * index, meaning, "ms")
        for index, (name, meaning) in enumerate(names_and_meanings)
    )


def _currents(offset: int) -> tuple[Field, ...]:
    return (
        Field("Current", "u16", offset, "present current of frame buffer and imager", "mA", 10),
        Field("MaxCurrent", "u16", offset + 16, "largest since power-up", "mA", 10),
        Field("MinCurrent", "u16", offset + 32, "smallest since power-up", "mA", 10),
    )


def _switch(name: str, offset: int) -> Field:
    return Field(name, "u8", offset, "load switch of imager and frame buffer", choices=SwitchState)


def _task(name: str, offset: int) -> Field:
    return Field(name, "enum8", offset, "what the node last did", choices=TaskStatus)


def _temperature(name: str, offset: int) -> Field:
    return Field(name, "i16", offset, "temperature of the processor", "degC", 100)


_NODE = (
    Message(
        128,
        "Identification",
        8,
        "what the node is, and its uptime",
        (
            Field("NodeType", "u8", 0, "type of node"),
            Field("InterfaceVersion", "u8", 8, "version of this interface"),
            Field("FirmwareVersionMajor", "u8", 16, "firmware version, major"),
            Field("FirmwareVersionMinor", "u8", 24, "firmware version, minor"),
            Field("RuntimeMilliseconds", "u16", 32, "uptime, part below one second", "ms"),
            Field("RuntimeSeconds", "u16", 48, "uptime, whole seconds, modulo 65536", "s"),
        ),
    ),
    Message(
        129,
        "ExtendedIdentification",
        11,
        "serial number and counters",
        (
            Field("SerialNumber", "u16", 0, "serial number"),
            _temperature("Temperature", 16),
            Field("ResetCause", "enum8", 32, "why the processor started", choices=ResetCause),
            Field("WDGResetCount", "u16", 40, "resets by the watchdog"),
            Field("TcmdCount", "u16", 56, "telecommands accepted, modulo 65536"),
            Field("TlmCount", "u16", 72, "telemetry requests answered, modulo 65536"),
        ),
    ),
    Message(
        130,
        "ErrorFlags",
        FLAG_BYTES,
        "errors since ClearErrorFlags; a flag stays up until then",
        flag_fields(),
    ),
    Message(
        131,
        "TcmdProcessed",
        1,
        "acknowledge: whether the last telecommand has been processed",
        (Field("Processed", "u8", 0, "1: processed, 0: not yet"),),
    ),
    Message(132, "TaskStatus", 1, "what the node last did", (_task("taskStatus", 0),)),
    Message(
        133,
        "StartAndLoopTime",
        6,
        "times of the main loop",
        times(
            ("StartupTime", "from reset to the main loop"),
            ("LoopTime", "latest iteration without the wait for the next"),
            ("MaxLoopTime", "longest iteration"),
        ),
    ),
    Message(
        134,
        "SRAMTestResults",
        1,
        "result of TestSRAM",
        (Field("TestResult", "u8", 0, "latest result", choices=MemoryTest),),
    ),
    Message(
        135,
        "PowerStatus",
        7,
        "switched supply of imager and frame buffer",
        (_switch("Status", 0), *_currents(8)),
    ),
)

_CAMERA = (
    Message(
        136,
        "Exposure",
        2,
        "exposure that is set",
        (Field("exposure", "u16", 0, "line times; 0: the longest the frame rate allows", "lines"),),
    ),
    Message(
        137,
        "ImageSetup",
        6,
        "part of the sensor that is read; fixed on this sensor",
        (
            Field("FirstLine", "u16", 0, "first row", "px", reset=0),
            Field("Width", "u16", 16, "columns", "px", reset=COLUMNS),
            Field("Height", "u16", 32, "rows", "px", reset=ROWS),
        ),
    ),
    Message(
        138,
        "CameraSetup",
        14,
        "registers of a later image sensor; this node answers as to an unknown ID",
        tuple(
            Field(name, "u16", 16 * index, "register of the later sensor")
            for index, name in enumerate(
                ("Line", "Misc1", "Misc2", "Clock", "Chain", "Ctrl", "Clamp")
            )
        ),
        supported=False,
    ),
    Message(
        139,
        "FocalLengthDetails",
        12,
        "focal lengths that are set",
        (
            Field("FocalLength", "f32", 0, "focal length of the unit vectors", "mm"),
            Field("Fx", "f32", 32, "of the distortion model, along the rows", "px"),
            Field("Fy", "f32", 64, "of the distortion model, along the columns", "px"),
        ),
    ),
    Message(
        140,
        "PrincipalPoint",
        8,
        "principal point that is set",
        (Field("Cx", "f32", 0, "column", "px"), Field("Cy", "f32", 32, "row", "px")),
    ),
    Message(
        141,
        "DistortionCoef",
        16,
        "distortion coefficients that are set, distorted to undistorted",
        (
            Field("K1", "f32", 0, "radial, of the squared radius"),
            Field("K2", "f32", 32, "radial, of its square"),
            Field("P1", "f32", 64, "tangential, along the columns"),
            Field("P2", "f32", 96, "tangential, along the rows"),
        ),
    ),
    Message(
        142,
        "IS_Register",
        2,
        "image sensor register that ReadFrom_IS_Register selected",
        (
            Field("DataH", "u8", 0, "always 0: this sensor's registers have 8 bits"),
            Field("DataL", "u8", 8, "value"),
        ),
    ),
    Message(
        143,
        "ImageBlock",
        128,
        "block that ImageBlockSet selected",
        (Field("Block", "bytes128", 0, "pixels, row after row; zero behind a shorter block"),),
    ),
    Message(
        144,
        "CameraTiming",
        6,
        "times of the image sensor's use",
        times(
            ("SetupTime", "writing the set-up"),
            ("ExposureUpdateTime", "writing the exposure"),
            ("CaptureTime", "from enable until the picture is stored"),
        ),
    ),
)

_LOG = (
    Message(
        173,
        "DelayTime",
        1,
        "delay between Trigger and the first capture",
        (Field("Timeout", "u8", 0, "delay", "s", 10),),
    ),
    Message(
        174,
        "LogStatus",
        26,
        "state and errors in one frame",
        (
            _temperature("Temp", 0),
            Field("Runtime", "u32", 16, "uptime", "s"),
            Field("WDGcounter", "u16", 48, "resets by the watchdog"),
            _task("Status", 64),
            _switch("SW", 72),
            *_currents(80),
            *flag_fields(128, log_names=True),
        ),
    ),
    Message(
        175,
        "Results",
        6,
        "counts of the latest picture",
        (
            Field("DarkValue", "u8", 0, "mean of the searched pixels below the threshold", "DN"),
            Field("Detected", "u8", 8, "stars detected"),
            Field("Invalid", "u8", 16, "areas that were too large"),
            Field("Noise", "u8", 24, "areas that were too small"),
            Field("IDMode", "u8", 32, "identification mode that is set", choices=IdMode),
            Field("ID", "u8", 40, "stars identified"),
        ),
    ),
)

NODE_TELEMETRY = _NODE + _CAMERA + _LOG

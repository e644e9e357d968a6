"""CubeStar's published telemetry.

CubeSpace family of nodes, interface version 3: IDs, names and layouts; IDs are as on the wire, bit
7 set. Assumed where the tables leave it open: times in ms, currents in 0.1 mA; star numbers count
the detected stars from 0; Identity and CatNum are the index in the onboard star list; centroids of
telemetry 170 to 172 in 0.02 px, magnitudes there are measured brightness in DN (no catalogue
magnitude is on board); confidence is the share of the other identified stars whose distance
agrees, in percent or as a fraction; the unit vectors of telemetry 176, printed as plain i16, have
the scale of all others. Quaternions rotate inertial vectors to camera vectors,
v_camera = q v_inertial q*, with the scalar in Qbar3. Angles are in rad.
"""

from functools import partial

from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS
from cubestack.firmware_model.interface.codec.field import (
    Field,
    bool1,
    byte_array,
    enum8,
    f32,
    i16,
    u8,
    u16,
    u32,
)
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.codec.node_messages import IDENTIFICATION
from cubestack.firmware_model.interface.cubestar import codes
from cubestack.firmware_model.interface.cubestar.flags import flag_fields

UNIT_VECTOR_SCALE = 10_000

_identity = partial(u16, meaning="index in the onboard star list; 65535: not identified")
_percent = partial(u8, meaning="confidence of the identification", unit="%")
_switch = partial(u8, meaning="load switch of imager and frame buffer", choices=codes.SwitchState)
_task = partial(enum8, meaning="latest activity of the node", choices=codes.TaskStatus)
_temperature = partial(i16, meaning="temperature of the processor", unit="degC", scale=100)

_STAR_NUMBER = u8("StarNumber", "number of the detected star, from 0")
_CURRENTS = (
    u16("Current", "present current of frame buffer and imager", "mA"),
    u16("MaxCurrent", "largest since power-up", "mA"),
    u16("MinCurrent", "smallest since power-up", "mA"),
)


def _times(*names_and_meanings: tuple[str, str]) -> tuple[Field, ...]:
    return tuple(u16(name, meaning, "ms") for name, meaning in names_and_meanings)


def _scaled(meaning: str, *names: str, unit: str = "") -> tuple[Field, ...]:
    return tuple(i16(name, meaning, unit, UNIT_VECTOR_SCALE) for name in names)


def _selected_star(number: int) -> Message:
    prefix = f"S{number}"
    return Message(
        169 + number, f"Star{number}Details", f"selected star {number}: centroid, vectors, identity"
    ).of(
        u16(f"{prefix}CentX", "measured column", "px"),
        u16(f"{prefix}CentY", "measured row", "px"),
        u16(f"{prefix}Mag", "brightness, sum over the centroiding window", "DN"),
        *_scaled("camera unit vector", *(f"{prefix}VB{axis}" for axis in "XYZ")),
        *_scaled("inertial unit vector", *(f"{prefix}VI{axis}" for axis in "XYZ")),
        _percent(f"{prefix}Conf"),
        _identity(f"{prefix}CatNum"),
    )


_QUATERNION = (
    *(
        field
        for index, part in enumerate(("x of the vector part", "y", "z", "scalar part"))
        for field in _scaled(f"{part}, inertial to camera", f"Qbar{index}")
    ),
)

_NODE = (
    IDENTIFICATION,
    Message(129, "ExtendedIdentification", "serial number and counters").of(
        u16("SerialNumber", "serial number"),
        _temperature("Temperature"),
        enum8("ResetCause", "why the processor started", choices=codes.ResetCause),
        u16("WDGResetCount", "resets by the watchdog", counter=True),
        u16("TcmdCount", "telecommands accepted, modulo 65536", counter=True),
        u16("TlmCount", "telemetry requests answered, modulo 65536", counter=True),
    ),
    Message(130, "ErrorFlags", "errors since ClearErrorFlags").of(*flag_fields()),
    Message(131, "TcmdProcessed", "acknowledge of the last telecommand").of(
        u8("Processed", "1: processed, 0: not yet")
    ),
    Message(132, "TaskStatus", "latest activity of the node").of(_task("taskStatus")),
    Message(133, "StartAndLoopTime", "times of the main loop").of(
        *_times(
            ("StartupTime", "from reset to the main loop"),
            ("LoopTime", "latest iteration without the wait for the next"),
            ("MaxLoopTime", "longest iteration"),
        )
    ),
    Message(134, "SRAMTestResults", "result of TestSRAM").of(
        u8("TestResult", "latest result", choices=codes.MemoryTest)
    ),
    Message(135, "PowerStatus", "switched supply of imager and frame buffer").of(
        _switch("Status"), *_CURRENTS
    ),
)

_CAMERA = (
    Message(136, "Exposure", "current exposure").of(
        u16("exposure", "line times; 0: as long as the frame rate allows", "lines")
    ),
    Message(137, "ImageSetup", "read part of the sensor, which is fixed").of(
        u16("FirstLine", "first row", "px", reset=0),
        u16("Width", "columns", "px", reset=COLUMNS),
        u16("Height", "rows", "px", reset=ROWS),
    ),
    Message(
        138,
        "CameraSetup",
        "registers of a later image sensor; this node rejects the ID as unknown",
        supported=False,
    ).of(
        *(
            u16(name, "register of the later sensor")
            for index, name in enumerate(
                ("Line", "Misc1", "Misc2", "Clock", "Chain", "Ctrl", "Clamp")
            )
        )
    ),
    Message(139, "FocalLengthDetails", "current focal lengths").of(
        f32("FocalLength", "focal length of the unit vectors", "mm"),
        f32("Fx", "of the distortion model, along the rows", "px"),
        f32("Fy", "of the distortion model, along the columns", "px"),
    ),
    Message(140, "PrincipalPoint", "current principal point").of(
        f32("Cx", "column", "px"), f32("Cy", "row", "px")
    ),
    Message(141, "DistortionCoef", "current distortion coefficients, distorted to undistorted").of(
        f32("K1", "radial, of the squared radius"),
        f32("K2", "radial, of its square"),
        f32("P1", "tangential, along the columns"),
        f32("P2", "tangential, along the rows"),
    ),
    Message(142, "IS_Register", "image sensor register that ReadFrom_IS_Register selected").of(
        u8("DataH", "always 0: this sensor's registers have 8 bits"), u8("DataL", "value")
    ),
    Message(143, "ImageBlock", "block that ImageBlockSet selected").of(
        byte_array(128, "Block", "pixels, row by row; a shorter block is padded with zeros")
    ),
    Message(144, "CameraTiming", "times of the image sensor").of(
        *_times(
            ("SetupTime", "set-up"),
            ("ExposureUpdateTime", "exposure setting"),
            ("CaptureTime", "from enable until the image is stored"),
        )
    ),
)

_DETECTION = (
    Message(145, "DetectionRegion", "part of the image that is searched, both ends included").of(
        u8("StepSize", "every n-th pixel of every n-th row", "px"),
        u16("Xstart", "first column", "px"),
        u16("Xend", "last column", "px"),
        u16("Ystart", "first row", "px"),
        u16("Yend", "last row", "px"),
    ),
    Message(146, "DetectionThresholdValues", "thresholds in use").of(
        u8("DarkThreshold", "dark level of the latest image", "DN"),
        u8("DetectionThreshold", "for a pixel of the search", "DN"),
        u8("StarThreshold", "for a neighbour while growing", "DN"),
    ),
    Message(147, "StarPixels", "number of pixels of a star").of(
        u8("MinPixels", "fewer are noise", "px"), u8("MaxPixels", "more are an invalid star", "px")
    ),
    Message(148, "StarGrid", "centroiding window").of(u8("GridSize", "side of the window", "px")),
    Message(149, "MaxStars", "limits that end the search").of(
        u8("maxStars", "stars found"),
        u8("maxInvalidStars", "areas that were too large"),
        u8("maxNoise", "areas that were too small"),
    ),
    Message(150, "DetectionSummary", "counts of the latest detection").of(
        u8("NumStarsDetected", "stars detected"),
        u8("NumInvalidStars", "areas that were too large"),
        u8("AmountOfNoise", "areas that were too small"),
        u8("ImageDarkValue", "mean of the searched pixels below the threshold", "DN"),
    ),
    Message(151, "StarPositions", "next detected star", steps=True).of(
        f32("X_Coordinate", "measured column", "px"),
        f32("Y_Coordinate", "measured row", "px"),
        f32("X_CorrectedCoordinate", "column without distortion", "px"),
        f32("Y_CorrectedCoordinate", "row without distortion", "px"),
        _STAR_NUMBER,
        u8("Size", "pixels of the area", "px"),
        u16("Intensity", "sum over the centroiding window", "DN"),
    ),
    Message(152, "BodyUnitVectors", "next detected star's direction in the camera", steps=True).of(
        *_scaled("camera unit vector", "VbX", "VbY", "VbZ"), _STAR_NUMBER
    ),
    Message(153, "DetectionTimingOne", "longest times of detection steps since the last reset").of(
        *_times(
            ("MaxStarSearchTime", "search and growing"),
            ("MaxCentroidFindTime", "centroids"),
            ("MaxCorrectionTime", "distortion"),
            ("MaxVectorCalTime", "unit vectors"),
        )
    ),
    Message(154, "DetectionTimingTwo", "times of the whole detection since the last reset").of(
        *_times(("StarDetectionTime", "latest"), ("MaxStarDetectionTime", "longest"))
    ),
)

_IDENTIFICATION = (
    Message(155, "IDMode", "identification mode").of(enum8("Mode", "mode", choices=codes.IdMode)),
    Message(156, "IDMargin", "tolerance of the distance between two stars").of(
        u8("Margin", "tolerance", "rad", 10_000)
    ),
    Message(157, "NumIdStars", "stars identified").of(u8("numIdStars", "stars identified")),
    Message(158, "IDStarsDetails", "next identified star", steps=True).of(
        _STAR_NUMBER,
        _identity("Identity"),
        u8("ValidationVotes", "other stars whose distance agrees"),
        _percent("Confidence"),
    ),
    Message(159, "InertialUnitVectors", "next identified star's inertial direction", steps=True).of(
        *_scaled("inertial unit vector", "ViX", "ViY", "ViZ"),
        _STAR_NUMBER,
        _identity("Identity"),
        _percent("Confidence"),
    ),
    Message(160, "IDTimingOne", "longest times of the first matching steps since reset").of(
        *_times(
            ("MaxModeSelectionTime", "selection of mode and star list"),
            ("MaxDistanceCalTime", "distances of the measured pairs"),
            ("MaxVoteRoundOneTime", "catalogue search and votes"),
            ("MaxFindIDTime", "selection of the top identities"),
        )
    ),
    Message(161, "IDTimingTwo", "longest times of the last matching steps since the last reset").of(
        *_times(
            ("MaxVoteRoundTwoTime", "verification votes"),
            ("MaxSelectID", "selection of the stars"),
            ("MaxAlgoCompletionTime", "completion"),
        )
    ),
    Message(162, "IDTimingThree", "times of the whole identification since the last reset").of(
        *_times(("StarIdentificationTime", "latest"), ("MaxStarIdentificationTime", "longest"))
    ),
    Message(163, "BestStarSelectionTime", "times of SelectBestStars since the last reset").of(
        *_times(("LatestTime", "latest"), ("MaxTime", "longest"))
    ),
)

_ATTITUDE = (
    Message(164, "Quaternion", "attitude, inertial to camera").of(*_QUATERNION),
    Message(165, "SphereicalCoordinates", "direction of the boresight").of(
        f32("Declination", "declination", "rad"),
        f32("RightAscension", "right ascension, -pi to pi", "rad"),
    ),
    Message(166, "AttitudeTiming", "times of the attitude estimate since the last reset").of(
        *_times(("LatestTime", "latest"), ("MaxTime", "longest"))
    ),
    Message(167, "PerformanceParameters", "outcome of the latest image").of(
        u8("NumStarsDetected", "stars detected"),
        u8("StarImageNoise", "areas that were too small"),
        u8("InvalidStars", "areas that were too large"),
        u8("NumberOfStarsID", "stars identified"),
        enum8("Idmode", "identification mode", choices=codes.IdMode),
        u8("ImageDarkValue", "mean of the searched pixels below the threshold", "DN"),
        bool1("ImageCaptureSuccess", "an image was stored"),
        bool1("DetectionSuccess", "stars were detected"),
        bool1("IdentificationSuccess", "stars were identified"),
        bool1("AttitudeSuccess", "an attitude was estimated"),
        bool1("ProcessingTimeError", "processing took longer than 500 ms"),
        bool1("MaxStarsDetected", "detection stopped at the limit of stars"),
        bool1("LessThanThreeStarsInFoV", "fewer than three stars in the field"),
        bool1("CommsError", "an error flag of the UART or I2C is raised"),
    ),
    Message(168, "TimingSummary", "latest times").of(
        *_times(
            ("ImageCaptureTime", "capture and transfer"),
            ("DetectionTime", "detection"),
            ("IdentificationTime", "identification"),
        )
    ),
    Message(169, "BestStarIndex", "stars that SelectBestStars chose").of(
        *(u8(f"Star{n}Index", "number of the detected star; 255: none") for n in (1, 2, 3))
    ),
    _selected_star(1),
    _selected_star(2),
    _selected_star(3),
    Message(176, "StarDetails", "next detected star: position, direction, identity", steps=True).of(
        _STAR_NUMBER,
        f32("CCx", "column without distortion", "px"),
        f32("CCy", "row without distortion", "px"),
        *(i16(name, "camera unit vector, in parts of 10 000") for name in ("Vbx", "Vby", "Vbz")),
        _identity("ID"),
        u8("ValidationVote", "other stars whose distance agrees"),
        f32("confidance", "confidence of the identification, 0 to 1"),
    ),
    Message(177, "AttitudeData", "attitude and boresight").of(
        *_QUATERNION,
        *_scaled("right ascension, -pi to pi", "RightAscension", unit="rad"),
        *_scaled("declination", "Declination", unit="rad"),
        *_scaled("boresight, inertial unit vector", "BSVX", "BSVY", "BSVZ"),
    ),
)

_LOG = (
    Message(173, "DelayTime", "Trigger to first capture").of(u8("Timeout", "delay", "x 10 ms")),
    Message(174, "LogStatus", "state and errors in one frame").of(
        _temperature("Temp"),
        u32("Runtime", "uptime", "s"),
        u16("WDGcounter", "resets by the watchdog", counter=True),
        _task("Status"),
        _switch("SW"),
        *_CURRENTS,
        *flag_fields(log_names=True),
    ),
    Message(175, "Results", "counts of the latest image").of(
        u8("DarkValue", "mean of the searched pixels below the threshold", "DN"),
        u8("Detected", "stars detected"),
        u8("Invalid", "areas that were too large"),
        u8("Noise", "areas that were too small"),
        u8("IDMode", "identification mode", choices=codes.IdMode),
        u8("ID", "stars identified"),
    ),
)

PUBLISHED_TELEMETRY = _NODE + _CAMERA + _DETECTION + _IDENTIFICATION + _ATTITUDE + _LOG

"""CubeStar's published telemetry, second part: detection, identification and attitude.

CubeSpace family of nodes, interface version 3: IDs, names and layouts. Ours where the tables leave
it open: times in ms; star numbers count the detected stars from 0; Identity and CatNum are the
index in the onboard star list; centroids of telemetry 170 to 172 in 0.02 px, magnitudes there are
measured brightness in DN (no catalogue magnitude is on board); confidence is the share of the
other identified stars whose distance agrees, in percent or as a fraction; the unit vectors of
telemetry 176, printed as plain i16, have the scale of all others. Quaternions turn inertial
vectors into camera vectors, v_camera = q v_inertial q*, with the scalar in Qbar3. Angles are in
rad.
"""

from cubestack.firmware_model.interface.codec.field import Field
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.cubestar.codes import IdMode
from cubestack.firmware_model.interface.cubestar.telemetry import times

__all__ = ["STAR_TELEMETRY"]

UNIT_VECTOR_SCALE = 10_000


def _scaled(offset: int, meaning: str, *names: str, unit: str = "") -> tuple[Field, ...]:
    """i16/10000 fields, one after the other."""
    return tuple(
        Field(name, "i16", offset + 16 * index, meaning, unit, UNIT_VECTOR_SCALE)
        for index, name in enumerate(names)
    )


def _star_number(offset: int) -> Field:
    return Field("StarNumber", "u8", offset, "number of the detected star, from 0")


def _identity(name: str, offset: int) -> Field:
    return Field(name, "u16", offset, "index in the onboard star list; 65535: not identified")


def _percent(name: str, offset: int) -> Field:
    return Field(name, "u8", offset, "confidence of the identification", "%")


def _selected_star(number: int) -> Message:
    """One of the three stars of highest confidence."""
    prefix = f"S{number}"
    return Message(
        169 + number,
        f"Star{number}Details",
        21,
        f"selected star {number}: centroid, vectors, identity",
        (
            Field(f"{prefix}CentX", "u16", 0, "measured column", "px", 50),
            Field(f"{prefix}CentY", "u16", 16, "measured row", "px", 50),
            Field(f"{prefix}Mag", "u16", 32, "brightness, sum over the centroiding window", "DN"),
            *_scaled(48, "camera unit vector", *(f"{prefix}VB{axis}" for axis in "XYZ")),
            *_scaled(96, "inertial unit vector", *(f"{prefix}VI{axis}" for axis in "XYZ")),
            _percent(f"{prefix}Conf", 144),
            _identity(f"{prefix}CatNum", 152),
        ),
    )


_QUATERNION = (
    *_scaled(0, "vector part, inertial to camera", "Qbar0", "Qbar1", "Qbar2"),
    *_scaled(48, "scalar part", "Qbar3"),
)

_DETECTION = (
    Message(
        145,
        "DetectionRegion",
        9,
        "part of the picture that is searched, both ends included",
        (
            Field("StepSize", "u8", 0, "every n-th pixel of every n-th row", "px"),
            Field("Xstart", "u16", 8, "first column", "px"),
            Field("Xend", "u16", 24, "last column", "px"),
            Field("Ystart", "u16", 40, "first row", "px"),
            Field("Yend", "u16", 56, "last row", "px"),
        ),
    ),
    Message(
        146,
        "DetectionThresholdValues",
        3,
        "thresholds in use",
        (
            Field("DarkThreshold", "u8", 0, "dark level of the latest picture", "DN"),
            Field("DetectionThreshold", "u8", 8, "for a pixel of the search", "DN"),
            Field("StarThreshold", "u8", 16, "for a neighbour while growing", "DN"),
        ),
    ),
    Message(
        147,
        "StarPixels",
        2,
        "number of pixels of a star",
        (
            Field("MinPixels", "u8", 0, "fewer are noise", "px"),
            Field("MaxPixels", "u8", 8, "more are an invalid star", "px"),
        ),
    ),
    Message(
        148,
        "StarGrid",
        1,
        "centroiding window",
        (Field("GridSize", "u8", 0, "side of the window", "px"),),
    ),
    Message(
        149,
        "MaxStars",
        3,
        "when the search stops",
        (
            Field("maxStars", "u8", 0, "stars found"),
            Field("maxInvalidStars", "u8", 8, "areas that were too large"),
            Field("maxNoise", "u8", 16, "areas that were too small"),
        ),
    ),
    Message(
        150,
        "DetectionSummary",
        4,
        "counts of the latest detection",
        (
            Field("NumStarsDetected", "u8", 0, "stars detected"),
            Field("NumInvalidStars", "u8", 8, "areas that were too large"),
            Field("AmountOfNoise", "u8", 16, "areas that were too small"),
            Field(
                "ImageDarkValue", "u8", 24, "mean of the searched pixels below the threshold", "DN"
            ),
        ),
    ),
    Message(
        151,
        "StarPositions",
        20,
        "next detected star",
        (
            Field("X_Coordinate", "f32", 0, "measured column", "px"),
            Field("Y_Coordinate", "f32", 32, "measured row", "px"),
            Field("X_CorrectedCoordinate", "f32", 64, "column without distortion", "px"),
            Field("Y_CorrectedCoordinate", "f32", 96, "row without distortion", "px"),
            _star_number(128),
            Field("Size", "u8", 136, "pixels of the area", "px"),
            Field("Intensity", "u16", 144, "sum over the centroiding window", "DN"),
        ),
        steps=True,
    ),
    Message(
        152,
        "BodyUnitVectors",
        7,
        "next detected star's direction in the camera",
        (*_scaled(0, "camera unit vector", "VbX", "VbY", "VbZ"), _star_number(48)),
        steps=True,
    ),
    Message(
        153,
        "DetectionTimingOne",
        8,
        "longest times of the detection's steps since the last reset",
        times(
            ("MaxStarSearchTime", "search and growing"),
            ("MaxCentroidFindTime", "centroids"),
            ("MaxCorrectionTime", "distortion"),
            ("MaxVectorCalTime", "unit vectors"),
        ),
    ),
    Message(
        154,
        "DetectionTimingTwo",
        4,
        "times of the whole detection since the last reset",
        times(("StarDetectionTime", "latest"), ("MaxStarDetectionTime", "longest")),
    ),
)

_IDENTIFICATION = (
    Message(
        155,
        "IDMode",
        1,
        "identification mode that is set",
        (Field("Mode", "enum8", 0, "mode", choices=IdMode),),
    ),
    Message(
        156,
        "IDMargin",
        1,
        "tolerance of the distance between two stars",
        (Field("Margin", "u8", 0, "tolerance", "rad", 10_000),),
    ),
    Message(
        157,
        "NumIdStars",
        1,
        "stars identified",
        (Field("numIdStars", "u8", 0, "stars identified"),),
    ),
    Message(
        158,
        "IDStarsDetails",
        5,
        "next identified star",
        (
            _star_number(0),
            _identity("Identity", 8),
            Field("ValidationVotes", "u8", 24, "other stars whose distance agrees"),
            _percent("Confidence", 32),
        ),
        steps=True,
    ),
    Message(
        159,
        "InertialUnitVectors",
        10,
        "next identified star's catalogue direction",
        (
            *_scaled(0, "inertial unit vector", "ViX", "ViY", "ViZ"),
            _star_number(48),
            _identity("Identity", 56),
            _percent("Confidence", 72),
        ),
        steps=True,
    ),
    Message(
        160,
        "IDTimingOne",
        8,
        "longest times of the identification's first steps since the last reset",
        times(
            ("MaxModeSelectionTime", "choice of mode and star list"),
            ("MaxDistanceCalTime", "distances of the measured pairs"),
            ("MaxVoteRoundOneTime", "catalogue search and votes"),
            ("MaxFindIDTime", "choice of the top identities"),
        ),
    ),
    Message(
        161,
        "IDTimingTwo",
        6,
        "longest times of the identification's last steps since the last reset",
        times(
            ("MaxVoteRoundTwoTime", "verification votes"),
            ("MaxSelectID", "choice of the stars to keep"),
            ("MaxAlgoCompletionTime", "completion"),
        ),
    ),
    Message(
        162,
        "IDTimingThree",
        4,
        "times of the whole identification since the last reset",
        times(("StarIdentificationTime", "latest"), ("MaxStarIdentificationTime", "longest")),
    ),
    Message(
        163,
        "BestStarSelectionTime",
        4,
        "times of SelectBestStars since the last reset",
        times(("LatestTime", "latest"), ("MaxTime", "longest")),
    ),
)

_ATTITUDE = (
    Message(164, "Quaternion", 8, "attitude, inertial to camera", _QUATERNION),
    Message(
        165,
        "SphereicalCoordinates",
        8,
        "direction of the boresight",
        (
            Field("Declination", "f32", 0, "declination", "rad"),
            Field("RightAscension", "f32", 32, "right ascension, -pi to pi", "rad"),
        ),
    ),
    Message(
        166,
        "AttitudeTiming",
        4,
        "times of the attitude estimate since the last reset",
        times(("LatestTime", "latest"), ("MaxTime", "longest")),
    ),
    Message(
        167,
        "PerformanceParameters",
        7,
        "outcome of the latest picture",
        (
            Field("NumStarsDetected", "u8", 0, "stars detected"),
            Field("StarImageNoise", "u8", 8, "areas that were too small"),
            Field("InvalidStars", "u8", 16, "areas that were too large"),
            Field("NumberOfStarsID", "u8", 24, "stars identified"),
            Field("Idmode", "enum8", 32, "identification mode that is set", choices=IdMode),
            Field(
                "ImageDarkValue", "u8", 40, "mean of the searched pixels below the threshold", "DN"
            ),
            Field("ImageCaptureSuccess", "bool1", 48, "a picture was stored"),
            Field("DetectionSuccess", "bool1", 49, "stars were detected"),
            Field("IdentificationSuccess", "bool1", 50, "stars were identified"),
            Field("AttitudeSuccess", "bool1", 51, "an attitude was estimated"),
            Field("ProcessingTimeError", "bool1", 52, "processing took longer than 500 ms"),
            Field("MaxStarsDetected", "bool1", 53, "detection stopped at the limit of stars"),
            Field("LessThanThreeStarsInFoV", "bool1", 54, "fewer than three stars in the field"),
            Field("CommsError", "bool1", 55, "an error flag of the UART or I2C is up"),
        ),
    ),
    Message(
        168,
        "TimingSummary",
        6,
        "latest times",
        times(
            ("ImageCaptureTime", "capture and transfer"),
            ("DetectionTime", "detection"),
            ("IdentificationTime", "identification"),
        ),
    ),
    Message(
        169,
        "BestStarIndex",
        3,
        "stars that SelectBestStars chose",
        tuple(
            Field(f"Star{n}Index", "u8", 8 * (n - 1), "number of the detected star; 255: none")
            for n in (1, 2, 3)
        ),
    ),
    _selected_star(1),
    _selected_star(2),
    _selected_star(3),
    Message(
        176,
        "StarDetails",
        22,
        "next detected star: position, direction, identity",
        (
            _star_number(0),
            Field("CCx", "f32", 8, "column without distortion", "px"),
            Field("CCy", "f32", 40, "row without distortion", "px"),
            *_scaled(72, "camera unit vector", "Vbx", "Vby", "Vbz"),
            _identity("ID", 120),
            Field("ValidationVote", "u8", 136, "other stars whose distance agrees"),
            Field("confidance", "f32", 144, "confidence of the identification, 0 to 1"),
        ),
        steps=True,
    ),
    Message(
        177,
        "AttitudeData",
        18,
        "attitude and boresight",
        (
            *_QUATERNION,
            *_scaled(64, "right ascension, -pi to pi", "RightAscension", unit="rad"),
            *_scaled(80, "declination", "Declination", unit="rad"),
            *_scaled(96, "boresight, inertial unit vector", "BSVX", "BSVY", "BSVZ"),
        ),
    ),
)

STAR_TELEMETRY = _DETECTION + _IDENTIFICATION + _ATTITUDE

"""AraMiS' error flags, all assumed."""

from cubestack.firmware_model.interface.codec.field import Field, flags_at

#: Bit and cause by name.
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
    "RamError": (27, "the catalogue in RAM was damaged and reloaded"),
    "UploadError": (28, "catalogue with a wrong length, checksum or contents, or a stray block"),
    "ConfigError": (29, "settings in flash were damaged; reset values are in use"),
}

FLAG_NAMES = frozenset(_FLAGS)


def flag_fields() -> tuple[Field, ...]:
    return flags_at((bit, name, cause, name) for name, (bit, cause) in _FLAGS.items())

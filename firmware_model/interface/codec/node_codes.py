"""Named numbers that all nodes of the CubeSpace family share."""

from enum import IntEnum


class AckError(IntEnum):
    """Error byte of a telecommand's acknowledge."""

    OK = 0
    INVALID_ID = 1
    WRONG_LENGTH = 2
    BAD_PARAMETER = 3
    BUFFER_FULL = 4  # an extension: the published list ends at 3

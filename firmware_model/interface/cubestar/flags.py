"""CubeStar's error flags: one declaration for telemetry ErrorFlags and LogStatus.

CubeSpace family of nodes, interface version 3. The two frames show the same ten bytes of flags; the
second prints a few names differently. The published tables have names only: the causes are worded
here. Some flags belong to hardware that this node lacks, or that does not fail here.
"""

from dataclasses import dataclass

from cubestack.firmware_model.interface.codec.field import Field, Flag, Severity, flags_at


@dataclass(frozen=True)
class ErrorFlag:
    """A flag of a node.

    Attributes:
        log_name: its name in LogStatus, if that differs.
        never: why it is never raised.
    """

    bit: int
    name: str
    cause: str
    log_name: str = ""
    never: str = ""


_GROUPS = {
    0: "supply",
    8: "UART",
    16: "I2C",
    24: "image",
    32: "settings",
    40: "requests",
    48: "detection",
    56: "identification",
    72: "flash",
}
"""What the flags from a bit on are about."""

_FAULTS = {"supply", "image", "flash"}
"""Groups whose flags are faults of hardware, unless a request caused them."""

_REQUESTED = {"StatusError", "TestPatternConfigError"}

_FLAGS = (
    ErrorFlag(0, "OverCurrent", "a supply current was above its limit and the switch was opened"),
    ErrorFlag(1, "UnderCurrent", "a switched-on supply drew almost no current"),
    ErrorFlag(8, "UART_ProtocolError", "byte outside of a frame, or an unknown escape"),
    ErrorFlag(9, "UART_TcmdBufOfError", "telecommand while the command buffer was full"),
    ErrorFlag(10, "UART_Tcmd_TooManyParm", "telecommand with too many parameter bytes"),
    ErrorFlag(11, "UART_Tcmd_TooFewParm", "telecommand with too few parameter bytes"),
    ErrorFlag(12, "UART_MsgIncomplete", "frame that never ended"),
    ErrorFlag(13, "UART_RXTimeout", "silence inside a frame"),
    ErrorFlag(16, "I2C_WaitForIDReadRequestError", "read with no telemetry ID written before"),
    ErrorFlag(17, "I2C_TcmdBufOFError", "telecommand while the command buffer was full"),
    ErrorFlag(18, "I2C_TCMD_TooFewParm", "telecommand with too few parameter bytes"),
    ErrorFlag(19, "I2C_TCMD_TooManyparm", "telecommand with too many parameter bytes"),
    ErrorFlag(24, "SPICommsError", "error on an SPI bus", never="there is no SPI bus"),
    ErrorFlag(25, "StatusError", "a step was requested before its input existed"),
    ErrorFlag(26, "ISSetupError", "the image sensor did not acknowledge an access", "ISsetupError"),
    ErrorFlag(27, "TestPatternConfigError", "unknown test pattern", "TestpatternConfigError"),
    ErrorFlag(28, "ImageCaptureError", "no whole image arrived in time"),
    ErrorFlag(29, "ISDisableError", "the image sensor did not acknowledge being disabled"),
    ErrorFlag(30, "ConfigChangeError", "the image sensor did not acknowledge a new setting"),
    ErrorFlag(31, "ISEnableError", "the image sensor did not acknowledge being enabled"),
    ErrorFlag(32, "FocalLengthRangeError", "focal length out of range"),
    ErrorFlag(
        33, "PrincipalPointRangeError", "principal point out of range", "BoresightRangeError"
    ),
    ErrorFlag(40, "ImageBlockSizeError", "unknown block size, or block beyond the image"),
    ErrorFlag(41, "TimingError", "the main loop took longer than a second", "MainLoopTimeError"),
    ErrorFlag(42, "TcmdIDError", "unknown telecommand ID"),
    ErrorFlag(43, "TlmIDError", "unknown telemetry ID"),
    ErrorFlag(44, "TriggerAlreadySet", "trigger while the loop was triggered already"),
    ErrorFlag(45, "TimerAlreadyRunning", "trigger while the delay timer was running"),
    ErrorFlag(46, "DelayTimeSetToLong", "delay above one second, or 0", "TimerTimeSetToLong"),
    ErrorFlag(48, "StarPixSetError", "pixel limits out of range or swapped", "PixSetError"),
    ErrorFlag(49, "MaxStarsSetError", "star limit out of range"),
    ErrorFlag(50, "MaxStarsDetection", "detection stopped at the limit of stars"),
    ErrorFlag(51, "MaxInvalidStarsDetectionError", "detection stopped at the limit of large areas"),
    ErrorFlag(52, "CentroidingGridSizeSetError", "unknown centroiding window"),
    ErrorFlag(53, "ValidImageRangeSetError", "detection region out of range or in the wrong order"),
    ErrorFlag(54, "MaxNoiseSetError", "noise limit out of range"),
    ErrorFlag(55, "MaxNoiseDetected", "detection stopped at the limit of small areas"),
    ErrorFlag(56, "SetIDModeError", "unknown identification mode"),
    ErrorFlag(57, "IDModeError", "tracking requested without an attitude or a hint"),
    ErrorFlag(58, "ReducedIDListSizeError", "no catalogue star near the rough boresight"),
    ErrorFlag(59, "LessThanThreeStarsInFoV", "fewer than three catalogue stars near the boresight"),
    ErrorFlag(60, "LessThanThreeStarsDetected", "fewer than three stars detected"),
    ErrorFlag(61, "LessThanThreeStarsID", "fewer than three stars identified"),
    ErrorFlag(62, "IDError", "identification found no consistent set of stars"),
    ErrorFlag(63, "IDSearchError", "no two detected stars confirmed each other's identity"),
    ErrorFlag(64, "DeclinationSetError", "declination out of range"),
    ErrorFlag(65, "RightAscensionSetError", "right ascension out of range"),
    ErrorFlag(66, "QuestindexError", "attitude requested with too few identified stars"),
    ErrorFlag(67, "RateExceeded", "tracking lost the stars: they moved beyond its radius"),
    ErrorFlag(
        72, "FlashInvalidAreaError", "flash access outside its area", never="pages are fixed"
    ),
    ErrorFlag(73, "FlashLockedError", "write to locked flash", never="it is never locked"),
    ErrorFlag(74, "FlashTimeoutError", "flash write timed out", never="modelled flash cannot fail"),
    ErrorFlag(75, "FlashUnalignedError", "unaligned flash write", never="whole pages are written"),
)

#: Flags that this node does not raise, and why.
NEVER_RAISED = {flag.name: flag.never for flag in _FLAGS if flag.never}


def flag_fields(*, log_names: bool = False) -> tuple[Field, ...]:
    """Fields of the block of flags, with LogStatus' names if ``log_names``."""
    return flags_at(
        Flag(
            flag.bit,
            flag.log_name if log_names and flag.log_name else flag.name,
            f"{flag.cause} (not on this node: {flag.never})" if flag.never else flag.cause,
            group := next(_GROUPS[bit] for bit in reversed(_GROUPS) if bit <= flag.bit),
            _severity(flag.name, group),
            flag.name,
        )
        for flag in _FLAGS
    )


def _severity(name: str, group: str) -> Severity:
    is_fault = group in _FAULTS and name not in _REQUESTED
    return Severity.FAULT if is_fault else Severity.NOTICE

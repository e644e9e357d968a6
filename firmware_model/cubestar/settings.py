"""Which telecommands are settings.

Kept in the battery-domain retention registers over the software reset that ends every iteration
(CubeStar thesis, section 5.3.6, and appendix E: "retention registers in backup power domain"), and
in flash by SaveConfig.
"""

from cubestack.firmware_model.interface.cubestar import INTERFACE

#: Telecommands whose parameters are kept.
SETTING_COMMANDS = (
    "setDelayTimerTimeout",
    "Exposure",
    "setFocalLength",
    "setFocalLengthComponents",
    "setPrincipalPoint",
    "setRadialDistortionGains",
    "setTangentalDistortionGains",
    "ImageBlockSet",
    "setDetectionRegion",
    "setDetectionThresholds",
    "setStarPixels",
    "setDetectionVariables",
    "setIDMode",
    "setTrackingMode",
    "setIDMargin",
    "SelectImageBank",
    "SetFrameRate",
    "SetDiscardDelay",
    "SetCameraRegisterPage",
)

SETTINGS_BYTES = sum(INTERFACE.telecommand(name).length for name in SETTING_COMMANDS)
"""Size of their parameters."""

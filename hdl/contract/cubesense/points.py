"""Functional coverage of CubeSense's contract."""

from cubestack.firmware_model.interface.cubesense.pins import PREFIXES
from cubestack.hdl.contract.points import Coverage, Group

_SIDES = tuple(map(str, PREFIXES))

POINTS = {
    "image": Group(
        "a whole image, by side", {"side": _SIDES, "done": ("stored", "read", "aborted")}
    ),
    "read": Group(
        "a read-out, by side and by what the camera's clock does",
        {"side": _SIDES, "camera": ("runs", "stopped")},
    ),
    "standby": Group("images that a camera sends in standby", {"side": _SIDES}),
}

hit = Coverage(POINTS).hit

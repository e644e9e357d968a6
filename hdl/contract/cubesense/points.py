"""Functional coverage of CubeSense's contract."""

from cubestack.firmware_model.interface.cubesense.fpga import Action, settled_rows
from cubestack.firmware_model.interface.cubesense.pins import PREFIXES
from cubestack.hdl.contract.points import Coverage, Group

_SIDES = tuple(map(str, PREFIXES))
_PLACE = {"camera": _SIDES, "memory": _SIDES}

#: Levels of the lines in which both FPGAs are in standby, and each knows it.
IDLE_ROWS = tuple(levels for levels, actions in settled_rows() if {*actions} == {Action.STANDBY})

POINTS = {
    "image": Group(
        "a whole image, by camera and memory",
        {**_PLACE, "done": ("stored", "read", "aborted", "stored beside the other")},
        lambda camera, memory, done: camera == memory or not done.endswith("other"),
    ),
    "border": Group(
        "a case at a frame's border, by camera and memory",
        {
            **_PLACE,
            "case": (
                *("joined in a frame", "frame too short", "pause as long as a gap"),
                *("last row too short", "row too long", "rows after ACK"),
            ),
        },
    ),
    "edge": Group("edge data that are read, by camera and memory", _PLACE),
    "sun": Group(
        "a Sun image, by memory",
        {
            "memory": _SIDES,
            "case": (
                *("inside", "at the border", "after two bright pixels", "across the end of a row"),
                *("none", "kept while others are stored"),
            ),
        },
    ),
    "read": Group(
        "a read-out, by side and by what the camera's clock does",
        {"side": _SIDES, "camera": ("runs", "stopped")},
    ),
    "standby": Group("images that a camera sends in standby", {"side": _SIDES}),
    "idle row": Group(
        "levels of SHIFT, EDGE, RNW, SUNEN and NADEN that are standby", {"levels": IDLE_ROWS}
    ),
}

hit = Coverage(POINTS).hit

"""Functional coverage of CubeStar's contract."""

from cubestack.hdl.contract.points import Coverage, Group

POINTS = {
    "image": Group("a whole image, by bank", {"bank": (0, 1), "done": ("stored", "read")}),
    "border": Group(
        "what a camera sends beside whole frames",
        {
            "case": (
                *("joined in a frame", "frame too short", "last row too short"),
                *("row too long", "rows after ACK"),
            )
        },
    ),
    "abort": Group(
        "a store that is left, in which state and by which pin",
        {"left_in": ("storing", "acknowledged"), "left_by": ("ENABLE", "RNW")},
    ),
    "standby": Group("a change in standby, of what", {"changes": ("camera", "RNW", "BANK")}),
    "read": Group(
        "a read-out, by bank and by what the camera's clock does",
        {"bank": (0, 1), "camera": ("runs", "stopped")},
    ),
    "bank": Group("BANK changes while a bank is stored in or read", {"bank": (0, 1)}),
}

hit = Coverage(POINTS).hit

"""The picture of docs/architecture.md: packages, and the paths of a pixel and of a host's byte."""

from collections.abc import Sequence
from html import escape
from typing import NamedTuple

from docs.diagrams.style import head

WIDTH, MARGIN, INSET, GAP = 1000, 10, 12, 8
FLOOR_HEIGHT, FLOOR_STEP, BOX_TOP, BOX_HEIGHT, TOP = 92, 118, 30, 50, 34
LETTER, TITLE_LETTER = 6.0, 8.0
"""Pixels; of letters, their usual width in the two sizes."""

PIXEL, BYTE = "pixel", "byte"


class Box(NamedTuple):
    """A folder, a word or two about it, and the steps of architecture.md that happen in it."""

    folder: str
    label: str = ""
    steps: str = ""


FLOORS: dict[str, Sequence[Box]] = {
    "host": (
        Box("api", "public names"),
        Box("studies", "campaigns"),
        Box("cli", "commands"),
        Box("sensors", "declared"),
        Box("ground", "browser"),
        Box("experiments", "beside truth"),
        Box("shell"),
        Box("emulation", "open device"),
        Box("devices", "registry"),
        Box("clients", "node, I2C", "8"),
        Box("transport", "serial, TCP", "7"),
    ),
    "emulator": (
        Box("scene", "stars, Earth", "1"),
        Box("camera", "by image sensor", "2"),
        Box("rtl", "engines, SRAM", "3"),
        Box("boards", "by sensor"),
        Box("sim", "processors", "4"),
        Box("iss", "runs an image"),
        Box("bus", "UART, I2C", "6b"),
        Box("ports", "pty, TCP", "7a"),
        Box("i2cdev", "/dev/i2c-N", "a"),
        Box("faults"),
        Box("recording"),
        Box("native", "C++"),
    ),
    "firmware_model": (
        Box("values", "limits"),
        Box("interface", "tables", "c"),
        Box("formats", "recordings"),
        Box("mcu", "requests, costs"),
        Box("attitude", "QUEST", "5"),
        Box("node", "satellite link", "6c"),
        Box("cubestar", steps="5d"),
        Box("cubesense"),
        Box("aramis"),
        Box("reference", "CubeStar in C"),
    ),
    "hdl": (
        Box("blocks", "counters, writer"),
        Box("cubestar", "tops", "3"),
        Box("cubesense", "tops, link"),
        Box("flow", "Verilog, C++, area"),
        Box("proofs", "formal properties"),
    ),
}

SHAPES = (
    "text{text-anchor:middle;font-size:13px}.title{font-weight:bold}.label{font-size:10.5px}"
    ".floor{text-anchor:start;font-size:14px;font-weight:bold}.key{text-anchor:start}"
    ".key{font-size:12px}.num{font-size:11px;font-weight:bold;fill:#fff}"
    f".{PIXEL}{{fill:#1f5fa8}}.{BYTE}{{fill:#b3541e}}"
)
LIGHT = {
    ".host": "fill:#f3dcef",
    ".emulator": "fill:#dbe7f6",
    ".firmware_model": "fill:#dff0d8",
    ".hdl": "fill:#f9e3c8",
    ".ground": "fill-opacity:.5;stroke:#bbb",
    ".folder": "stroke:#333",
}
DARK = {
    ".host": "fill:#4a2f47",
    ".emulator": "fill:#263b58",
    ".firmware_model": "fill:#2c4526",
    ".hdl": "fill:#523d22",
    ".ground": "fill-opacity:.5;stroke:#555",
    ".folder": "stroke:#999",
}


def architecture() -> str:
    """The picture as SVG."""
    end = TOP + FLOOR_STEP * (len(FLOORS) - 1) + FLOOR_HEIGHT
    parts = head(WIDTH, end + 50, SHAPES, LIGHT, DARK)
    parts.append(_text("key", MARGIN + INSET, 22, "Imports run downward, from the upper packages."))
    numbers: list[str] = []
    for level, (floor, boxes) in enumerate(FLOORS.items()):
        y = TOP + FLOOR_STEP * level
        parts += [
            f'<rect class="{floor} ground" x="{MARGIN}" y="{y}" width="{WIDTH - 2 * MARGIN}" '
            f'height="{FLOOR_HEIGHT}" rx="8"/>',
            _text("floor soft", MARGIN + INSET, y + 20, f"{floor}/"),
        ]
        x = float(MARGIN + INSET)
        for box, width in zip(boxes, _widths(boxes), strict=True):
            parts += _folder(floor, box, x, y + BOX_TOP, width)
            for number, step in enumerate(box.steps):
                numbers += _number(step, x + width / 5 + 22 * number, y + BOX_TOP)
            x += width + GAP
    parts += numbers
    for x, step, text in (
        (31, "1", "path of a pixel"),
        (191, "a", "path of a host's byte; the text explains each step"),
    ):
        parts += [*_number(step, x, end + 30), _text("key", x + 15, end + 34, text)]
    return "\n".join([*parts, "</svg>", ""])


def _widths(boxes: Sequence[Box]) -> list[float]:
    """What the words need, stretched to the floor's width."""
    needed = [max(TITLE_LETTER * len(box.folder), LETTER * len(box.label)) for box in boxes]
    room = WIDTH - 2 * (MARGIN + INSET) - GAP * (len(boxes) - 1)
    return [round(one + (room - sum(needed)) / len(boxes), 1) for one in needed]


def _folder(floor: str, box: Box, x: float, y: float, width: float) -> list[str]:
    middle = x + width / 2
    return [
        f'<rect class="{floor} folder" x="{x:.1f}" y="{y}" width="{width}" height="{BOX_HEIGHT}" '
        'rx="6"/>',
        _text("title", middle, y + (22 if box.label else 30), box.folder),
        _text("label soft", middle, y + 40, box.label),
    ]


def _number(step: str, x: float, y: float) -> list[str]:
    path = PIXEL if step.isdigit() else BYTE
    return [f'<circle class="{path}" cx="{x:.1f}" cy="{y}" r="9"/>', _text("num", x, y + 4, step)]


def _text(kind: str, x: float, y: float, text: str) -> str:
    return f'<text class="{kind}" x="{x:.1f}" y="{y}">{escape(text)}</text>' if text else ""

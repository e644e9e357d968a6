"""Foreign designs with CubeStar's pins, written in the styles of other people."""

from pathlib import Path
from typing import Any

from cubestack.hdl.cubestar.top import CubeStarTop
from cubestack.hdl.user import Gateware, load_gateware

FOLDER = Path(__file__).parent

#: Frame buffers of CubeStar, by name: each stores and reads what the shipped one does.
WORKING = {
    file.stem: file
    for file in sorted(FOLDER.glob("*.*v"))
    if file.suffix in (".v", ".sv") and file.stem not in ("clock_styles", "system_clock")
}

#: Not a frame buffer, but one of each style of clocking.
CLOCK_STYLES = FOLDER / "clock_styles.v"

#: Needs a pin that the board does not have.
SYSTEM_CLOCK = FOLDER / "system_clock.v"


def load_design(file: Path, columns: int = 1024, rows: int = 512, **more: Any) -> Gateware:
    size = {"COLUMNS": columns, "ROWS": rows}
    return load_gateware(str(file), CubeStarTop(columns, rows).pins, {**size, **more})

"""Writes the generated sources of the reference firmware: tables, pins, the part's registers.

`python -m cubestack.firmware_model.reference.generate FOLDER`. The interface's own C header and the
catalogue come from the host's tools; see the Makefile.
"""

import sys
from pathlib import Path

from cubestack.firmware_model.interface.cubestar.processor_pins import pins_header
from cubestack.firmware_model.interface.efm32gg import LAYOUTS
from cubestack.firmware_model.interface.efm32gg.c_header import c_header
from cubestack.firmware_model.reference import tables


def generate(folder: Path) -> None:
    """Write the files into ``folder``, which is created if needed."""
    folder.mkdir(parents=True, exist_ok=True)
    texts = {
        "cubestar_tables.h": tables.header(),
        "cubestar_tables.c": tables.source(),
        "pins.h": pins_header(),
        "efm32gg.h": c_header(LAYOUTS),
    }
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="ascii")


if __name__ == "__main__":
    generate(Path(sys.argv[1]))

"""Reads the JSON that nextpnr writes with ``--write``."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from cubestack.hdl.devboard.boards import Family
from cubestack.hdl.devboard.netlist import ecp5, ice40
from cubestack.hdl.devboard.netlist.cells import Netlist

_READERS: dict[Family, Callable[[dict[str, Any]], Netlist]] = {
    "ice40": ice40.read,
    "ecp5": ecp5.read,
}


def read_netlist(file: Path, family: Family) -> Netlist:
    """The placed netlist of a bridged design; NetlistError for a cell without a model."""
    module = json.loads(file.read_text(encoding="utf-8"))["modules"]["top"]
    found = _READERS[family](module)
    for name, net in module["netnames"].items():
        for bit, number in enumerate(net["bits"]):
            text = f"{name}[{bit}]" if len(net["bits"]) > 1 else name
            found.names.setdefault(number, text)
    return found

from types import SimpleNamespace
from typing import Any

import pytest

from cubestack.emulator.boards.monitor import Monitor
from cubestack.emulator.iss.insight.symbols import Symbols


def monitor(engine: object) -> Monitor:
    board: Any = SimpleNamespace(engine=engine)
    return Monitor(board, Symbols(None))


def test_pins_are_those_of_the_processor_and_the_outputs() -> None:
    wiring = SimpleNamespace(mcu_pins=("ENABLE", "RNW"), output_pins=("ACK", "DATA"))
    levels = {"ENABLE": 1, "RNW": 0, "ACK": 1, "DATA": 0x5A}
    engine = SimpleNamespace(wiring=wiring, get_pin=levels.__getitem__)
    assert monitor(engine)(["pins"]) == "ENABLE 0x1\nRNW 0x0\nACK 0x1\nDATA 0x5a"
    assert monitor(None)(["pins"]) == "no FPGA"


def test_rejects_unknown_pin_commands() -> None:
    with pytest.raises(ValueError, match="no command 'pin'; known: reset, catch, help, time"):
        monitor(None)(["pin"])

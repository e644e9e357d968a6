"""What of the I2C option needs no simulation: pins, refusals, and the figures in its document."""

import gc
import re
from collections.abc import Callable
from pathlib import Path

import i2c_times
import pytest
from amaranth.lib.wiring import Component

from cubesense_fpga_i2c.pair import CubeSenseI2cPair
from cubesense_fpga_i2c.pins import FPGA
from cubesense_fpga_i2c.register_table import (
    ADDRESSES,
    GROUP_ADDRESS,
    REGISTERS,
    Register,
    command_of,
)
from cubesense_fpga_i2c.target import I2cTarget
from cubesense_fpga_i2c.top import CubeSenseI2cFpga
from cubestack.firmware_model.interface.cubesense.fpga import FULL_SIZE
from cubestack.firmware_model.interface.cubesense.pins import FPGA as PARALLEL_FPGA
from cubestack.hdl.flow.area import AGLN030_TILES, count_tiles
from cubestack.hdl.flow.generate import rtlil_text

DOCUMENT = Path(__file__).parents[1] / "README.md"


def test_i2c_fpga_has_the_declared_pins() -> None:
    top = CubeSenseI2cFpga("sun")
    rtlil_text(top)  # a design must be used, Amaranth says
    ports = {port.name for pin in FPGA for port in pin.ports}
    parallel = {port.name for pin in PARALLEL_FPGA for port in pin.ports}
    assert ports == set(top.signature.members)
    assert ports - parallel == {"SCL", "SDA_I", "SDA_O", "SDA_OE", "RESET_N"}
    assert sum(pin.width for pin in PARALLEL_FPGA) - sum(pin.width for pin in FPGA) == 11


def test_pair_has_every_pin_but_the_links() -> None:
    pair = CubeSenseI2cPair()
    rtlil_text(pair)
    members = set(pair.signature.members)
    assert {"SCL", "SDA", "SDA_I", "RESET_N", "CONTENTION"} < members
    assert not [name for name in members if "LINK" in name]
    assert {n[4:] for n in members if n.startswith("SUN_")} == {
        n[4:] for n in members if n.startswith("NAD_")
    }


@pytest.mark.filterwarnings("ignore::amaranth.hdl.UnusedElaboratable")
@pytest.mark.parametrize(
    ("make", "error"),
    [
        (lambda: CubeSenseI2cFpga("moon"), 'must be "sun" or "nadir", not \'moon\''),
        (lambda: I2cTarget(0x07, 0x30), r"must be in 0x08\.\.0x77, not 0x07"),
        (lambda: I2cTarget(0x31, 0x78), r"must be in 0x08\.\.0x77, not 0x78"),
        (lambda: I2cTarget(0x31, 0x31), "address and group address are both 0x31"),
        (lambda: I2cTarget(0x31, 0x30, number_bits=9), r"number_bits must be in 1\.\.8, not 9"),
    ],
)
def test_rejects_invalid_designs(make: Callable[[], Component], error: str) -> None:
    with pytest.raises(ValueError, match=error):
        make()
    gc.collect()  # what was refused is never elaborated; have Amaranth say so here


def rows(heading: str) -> list[list[str]]:
    """Cells of the table below a heading of the document."""
    text = DOCUMENT.read_text(encoding="utf-8")
    section = text.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    assert section, f"no section {heading}"
    lines = [line for line in section.splitlines() if line.startswith("|")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return cells[2:]


def test_documentation_lists_every_register() -> None:
    wanted = [
        [
            f"0x{r.address:X}",
            f"`{r.name}`",
            r.access.value,
            f"0x{r.field.reset:02X}",
            r.field.meaning,
        ]
        for r in REGISTERS
    ]
    for row, register in zip(wanted, REGISTERS, strict=True):
        if not register.writable and register.address != Register.STATUS:
            row[3] = ""  # fixed, kept over reset, or the memory's
    assert rows("Registers") == wanted


def test_documentation_lists_every_active_command() -> None:
    for byte, *names in rows("Commands"):
        found = command_of(int(byte, 16))
        assert [found.sun.name.lower(), found.nadir.name.lower()] == names
    active = {byte for byte in range(16) if {a.name for a in command_of(byte)} != {"STANDBY"}}
    assert {int(row[0], 16) for row in rows("Commands")} == {*active, 3}


def test_documented_tile_counts_match_the_design() -> None:
    found = {row[0]: row[1:] for row in rows("Tiles and pins")}
    count = count_tiles(CubeSenseI2cFpga("sun"))
    assert found["on I2C"] == ["53", *(str(n) for n in (*count, count.total))]
    assert count == count_tiles(CubeSenseI2cFpga("nadir"))
    assert count.total <= AGLN030_TILES


def milliseconds(text: str) -> float:
    number, unit = text.split()
    return float(number) * {"us": 1e-3, "ms": 1.0, "s": 1e3}[unit]


def test_documented_times_match_the_computed_times() -> None:
    """Periods exactly; times as rounded there."""
    size = FULL_SIZE
    wanted = {
        "a command": i2c_times.COMMAND,
        "one read of STATUS": i2c_times.STATUS,
        "a single pixel": i2c_times.PIXEL,
        "Sun position and window": i2c_times.window(),
        "scan of 9920 samples": i2c_times.scan(),
        "whole image": i2c_times.PICTURE,
    }
    assert sum(1 for pixel in size.scan() if pixel) == 9920
    table = {row[0]: row[1:] for row in rows("Time")}
    for name, periods in wanted.items():
        printed, *times = table[name][:4]
        assert float(printed.replace(" ", "")) == float(periods), name
        for speed, time in zip((100e3, 400e3, 1e6), times, strict=True):
            exact = float(periods) / speed * 1e3
            assert milliseconds(time) == pytest.approx(exact, rel=5e-3), name


def test_documentation_lists_every_i2c_address() -> None:
    text = DOCUMENT.read_text(encoding="utf-8")
    for address in (*ADDRESSES.values(), GROUP_ADDRESS):
        assert re.search(rf"0x{address:02X}\b", text)

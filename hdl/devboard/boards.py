"""The development boards, declared: part, clock, PLL, pins of the serial port.

iCEBreaker V1.0 (1BitSquared; repository icebreaker-fpga/icebreaker, hardware/v1.0e, and
YosysHQ/icestorm, examples/icebreaker/icebreaker.pcf): iCE40UP5K-SG48, 12 MHz at pin 35, UART of the
FT2232H at pins 6 (to the FPGA) and 9 (from it).

ULX3S v3.x.x (Radiona; repository emard/ulx3s, doc/constraints/ulx3s_v20.lpf): LFE5U-12F to -85F,
CABGA381, 25 MHz at pin G2, UART of the FT231X at pins M1 (ftdi_txd, to the FPGA) and L4
(ftdi_rxd, from it).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from amaranth.hdl import Instance, Value

Family = Literal["ice40", "ecp5"]


@dataclass(frozen=True)
class Board:
    """A board that bitstreams are built for."""

    name: str
    title: str
    family: Family
    part: tuple[str, ...]  #: options of nextpnr
    clk_pin: str
    clk_mhz: float
    rx_pin: str  #: input of the FPGA
    tx_pin: str  #: output of the FPGA
    bridge_hz: int  #: what the PLL makes of the clock
    pll: Callable[[Value, Value, Value], Instance]  #: of clock, output clock and lock signal

    @property
    def constraints(self) -> str:
        """Content of the file that nextpnr reads: PCF or LPF."""
        pins = {"clk": self.clk_pin, "rx": self.rx_pin, "tx": self.tx_pin}
        if self.family == "ice40":
            lines = [f"set_io {port} {pin}" for port, pin in pins.items()]
            lines.append(f"set_frequency clk {self.clk_mhz:g}")
        else:
            lines = [f'LOCATE COMP "{port}" SITE "{pin}";' for port, pin in pins.items()]
            lines += [f'IOBUF PORT "{port}" IO_TYPE=LVCMOS33;' for port in pins]
            lines.append(f'FREQUENCY PORT "clk" {self.clk_mhz:g} MHZ;')
        return "\n".join(lines) + "\n"


def _ice40_pll(clk: Value, out: Value, locked: Value) -> Instance:
    """12 MHz from 12 MHz: the oscillator runs at 12 x 64 = 768 MHz (iCE40 sysCLOCK PLL guide).

    The lock signal starts the bridge.
    """
    return Instance(
        "SB_PLL40_PAD",
        p_FEEDBACK_PATH="SIMPLE",
        p_DIVR=0,
        p_DIVF=63,
        p_DIVQ=6,
        p_FILTER_RANGE=1,
        i_PACKAGEPIN=clk,
        i_RESETB=1,
        i_BYPASS=0,
        o_PLLOUTGLOBAL=out,
        o_LOCK=locked,
    )


def _ecp5_pll(clk: Value, out: Value, locked: Value) -> Instance:
    """30 MHz from 25 MHz: 25 / 5 x 6; the oscillator runs at 600 MHz (Lattice FPGA-TN-02200)."""
    return Instance(
        "EHXPLLL",
        p_CLKI_DIV=5,
        p_CLKFB_DIV=6,
        p_CLKOP_DIV=20,
        p_CLKOP_ENABLE="ENABLED",
        p_CLKOP_CPHASE=19,
        p_CLKOP_FPHASE=0,
        p_FEEDBK_PATH="CLKOP",
        p_PLLRST_ENA="DISABLED",
        p_INTFB_WAKE="DISABLED",
        p_STDBY_ENABLE="DISABLED",
        p_DPHASE_SOURCE="DISABLED",
        i_CLKI=clk,
        i_CLKFB=out,
        i_RST=0,
        i_STDBY=0,
        i_PHASESEL0=0,
        i_PHASESEL1=0,
        i_PHASEDIR=1,
        i_PHASESTEP=1,
        i_PHASELOADREG=1,
        i_PLLWAKESYNC=0,
        i_ENCLKOP=0,
        o_CLKOP=out,
        o_LOCK=locked,
    )


def _ulx3s(size: str) -> Board:
    part = (f"--{size}", "--package", "CABGA381", "--speed", "6")
    name = "ulx3s" if size == "85k" else f"ulx3s-{size.removesuffix('k')}f"
    title = f"ULX3S with LFE5U-{size.removesuffix('k').upper()}F"
    pins = {"clk_pin": "G2", "rx_pin": "M1", "tx_pin": "L4"}
    return Board(name, title, "ecp5", part, clk_mhz=25, bridge_hz=30_000_000, pll=_ecp5_pll, **pins)


#: By name.
BOARDS: Mapping[str, Board] = {
    board.name: board
    for board in (
        Board(
            "icebreaker",
            "iCEBreaker with iCE40UP5K",
            "ice40",
            ("--up5k", "--package", "sg48"),
            clk_pin="35",
            clk_mhz=12,
            rx_pin="6",
            tx_pin="9",
            bridge_hz=12_000_000,
            pll=_ice40_pll,
        ),
        _ulx3s("85k"),
        _ulx3s("12k"),
    )
}

"""SunSlit's FPGA: starts the array, stores what comes out of it, hands it to the microcontroller.

An exposure takes two start pulses, and each puts all pixels out. What was integrated before the
first one is of no use, so the memory holds two rows, and the second is the picture.

OSC clocks what stores, and not storing is its reset, asserted at once and released through two
flip-flops. EXPOSE comes in through two flip-flops of OSC. ADC and VALID change with OSC's falling
edge. ENABLE, RNW and DCLK come from the microcontroller one after the other, so "not reading" is
the reset of DCLK's domain as it is.
"""

from amaranth.hdl import ClockDomain, ClockSignal, Module, Mux, ResetSignal, Signal
from amaranth.lib.cdc import ResetSynchronizer

from cubestack.hdl.blocks import FrameReader, FrameWriter, PinnedComponent
from cubestack.sensor import Clock, Top
from linear_sun_sensor.interface import PIXELS
from linear_sun_sensor.pins import PINS

READOUTS = 2


class SunSlitTop(PinnedComponent):
    """Start pulses, line buffer, read-out.

    ENABLE = 0: standby, every output but CLK at its reset value. ENABLE = 1, RNW = 0: each edge of
    EXPOSE gives a start pulse of one clock; ACK rises when two readouts are stored. ENABLE = 1,
    RNW = 1: each rising DCLK presents the next byte.
    """

    def __init__(self) -> None:
        super().__init__(PINS)

    def elaborate(self, platform: object) -> Module:
        m = Module()
        m.domains.osc = ClockDomain(async_reset=True)
        m.domains.dclk = ClockDomain(async_reset=True)
        storing, reading = Signal(), Signal()
        met, exposing, exposed = Signal(), Signal(), Signal()
        m.submodules.osc_reset = ResetSynchronizer(~storing, domain="osc")
        m.submodules.writer = writer = FrameWriter(PIXELS, READOUTS, domain="osc")
        m.submodules.reader = reader = FrameReader(PIXELS, READOUTS, domain="dclk")
        m.d.osc += [
            met.eq(self.EXPOSE),
            exposing.eq(met),
            exposed.eq(exposing),
            self.SI.eq(exposing != exposed),
        ]
        m.d.comb += [
            storing.eq(self.ENABLE & ~self.RNW),
            reading.eq(self.ENABLE & self.RNW),
            ClockSignal("osc").eq(self.OSC),
            ClockSignal("dclk").eq(self.DCLK),
            ResetSignal("dclk").eq(~reading),
            self.CLK.eq(self.OSC),
            writer.pixel.eq(self.ADC),
            writer.hsync.eq(self.VALID),
            writer.vsync.eq(1),
            self.ACK.eq(writer.ack),
            reader.memory.eq(self.SRAM_D_I),
            self.DATA.eq(reader.data),
            self.SRAM_A.eq(Mux(self.RNW, reader.address, writer.address)),
            self.SRAM_D_O.eq(writer.data),
            self.SRAM_D_OE.eq(writer.store),
            self.SRAM_CE_N.eq(~self.ENABLE),
            self.SRAM_OE_N.eq(~reading),
            self.SRAM_WE_N.eq(~writer.store | self.OSC),
        ]
        return m


TOPS = {
    "sunslit": Top(
        SunSlitTop,
        "SunSlit line buffer",
        (Clock("OSC", 2000, "oscillator at 500 kHz"), Clock("DCLK", 500, "24 cycles at 48 MHz")),
    )
}

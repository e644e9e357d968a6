"""SRAM to microcontroller: the whole image, the nadir scan or the Sun window, byte by byte.

CubeSense thesis, section 6.4.2 (microcontroller, edge and address control) and figures 6.7 and
6.16; section 9.2.2 (address control from the microcontroller). The microcontroller generates the
clock, so it alone sets the rate, and reading works when no camera has a clock.
"""

from amaranth.hdl import Cat, ClockDomain, ClockSignal, Module, Mux, ResetSignal
from amaranth.lib.wiring import Component, In, Out

from cubestack.firmware_model.interface.cubesense.fpga import ReadOut
from cubestack.hdl.blocks.counters import MatrixCounter
from cubestack.hdl.cubesense.nadir_scan import NadirScan
from cubestack.hdl.cubesense.sun_window import SunWindow


class CubeSenseReader(Component):
    """Presents the next byte at each rising edge of ``clk``, in one of three orders.

    At most one of the three requests is high. Each request releases its order's reset: while it is
    low the order stays at its first byte, and while all are low ``address`` and ``data`` are 0.

    Ports:
        clk: data clock.
        picture: row by row without end; the last pixel is followed by the first one.
        scan: the nadir scan.
        window: the Sun window.
        sun_x, sun_y: first Sun pixel, for the window.
        address: SRAM address of the byte that the next edge presents.
        memory: the byte that the SRAM offers at that address.
        data: the byte presented.
        addressing: a fourth request, with ``mcu_addressing`` only: the image, but while
            ``take_address`` is high each edge shifts a byte into the address instead, from the
            low end, and ``data`` is 0.
        take_address, read_from: the kind of ``addressing``; both low without it.
        address_byte: from the microcontroller.
    """

    def __init__(self, read_out: ReadOut, *, mcu_addressing: bool = False) -> None:
        self._read_out = read_out
        self._mcu_addressing = mcu_addressing
        requests = dict.fromkeys(("clk", "picture", "scan", "window"), In(1))
        sun = {"sun_x": In(read_out.column_bits), "sun_y": In(read_out.row_bits)}
        memory = {"address": Out(read_out.address_bits), "memory": In(8), "data": Out(8)}
        option = dict.fromkeys(("addressing", "take_address", "read_from"), In(1))
        option["address_byte"] = In(8)
        super().__init__({**requests, **sun, **memory, **(option if mcu_addressing else {})})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        size = self._read_out
        picture_wanted = output_wanted = self.picture
        if self._mcu_addressing:
            picture_wanted = self.picture | self.addressing
            output_wanted = self.picture | self.read_from
        requests = {"picture": picture_wanted, "scan": self.scan, "window": self.window}
        domains = {**requests, "output": output_wanted | self.scan | self.window}
        for name, wanted in domains.items():
            m.domains += ClockDomain(name, async_reset=True, local=True)
            m.d.comb += [ClockSignal(name).eq(self.clk), ResetSignal(name).eq(~wanted)]

        m.submodules.picture = picture = MatrixCounter(
            size.columns, size.rows, domain="picture", loadable=self._mcu_addressing
        )
        m.submodules.scan = scan = NadirScan(size, domain="scan")
        m.submodules.window = window = SunWindow(size, domain="window")
        m.d.comb += [
            picture.next_column.eq(1),
            window.x.eq(self.sun_x),
            window.y.eq(self.sun_y),
            # In reset the address of each is 0.
            self.address.eq(picture.address | scan.address | window.address),
        ]
        if self._mcu_addressing:
            shifted = Cat(self.address_byte, picture.address)[: len(picture.address)]
            m.d.comb += [picture.load.eq(self.take_address), picture.position.eq(shifted)]
        m.d.output += self.data.eq(Mux(self.window & window.coordinate, window.byte, self.memory))
        return m

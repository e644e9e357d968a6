"""A board's side of the protocol, in gateware: from the serial line to the pins of a design."""

from collections.abc import Iterable
from dataclasses import dataclass

from amaranth.hdl import Cat, Module
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import Component, In, Out
from amaranth.utils import ceil_log2

from cubestack.firmware_model.interface.devboard import (
    BUFFER,
    LONGEST_REQUEST,
    RESPONSES,
    VERSION,
    WINDOW,
    Identity,
    Lines,
)
from cubestack.firmware_model.interface.pins import Pin
from cubestack.hdl.devboard.engine import SLOT, Engine
from cubestack.hdl.devboard.framing import FrameReceiver, FrameSender
from cubestack.hdl.devboard.pin_registers import PinRegisters
from cubestack.hdl.devboard.serial_line import SerialReceiver, SerialSender


@dataclass(frozen=True)
class BridgeTiming:
    """Rates of a bridge.

    Attributes:
        clock_hz: of its clock.
        baud: of the serial line.
        settle: clocks from a change of the inputs to the use of the outputs.
    """

    clock_hz: int
    baud: int
    settle: int = 2

    def __post_init__(self) -> None:
        """Raise ValueError for a rate that the clock can not be divided to within 1 %."""
        most = self.clock_hz // 2
        if not 1 <= self.baud <= most or abs(self.clock_hz / self.divider / self.baud - 1) > 0.01:
            near = self.clock_hz / max(2, round(self.clock_hz / max(1, self.baud)))
            raise ValueError(
                f"a clock of {self.clock_hz / 1e6:g} MHz can not be divided to {self.baud} baud; "
                f"the nearest rate is {near:.0f}"
            )

    @property
    def divider(self) -> int:
        return round(self.clock_hz / self.baud)


class PinBridge(Component):
    """Executes requests on the pins of a design.

    Ports:
        rx, tx: the serial line.
        inputs, outputs: the design's pins, packed as the protocol does.
    """

    def __init__(
        self, pins: Iterable[Pin], lines: Lines, timing: BridgeTiming, name: str, design: bytes
    ) -> None:
        """``name`` and ``design`` are those of the board's identity."""
        self._registers = PinRegisters(pins, lines)
        self._timing = timing
        sizes = self._registers.into.size, self._registers.out.size
        limits = WINDOW, BUFFER, LONGEST_REQUEST
        rates = timing.clock_hz, timing.baud
        self.identity = Identity(VERSION, *sizes, *limits, *rates, design[:8], name[:16])
        super().__init__(
            {
                "rx": In(1, init=1),
                "tx": Out(1, init=1),
                "inputs": Out(8 * sizes[0], init=self._registers.into.initial),
                "outputs": In(8 * sizes[1]),
            }
        )

    def elaborate(self, platform: object) -> Module:
        m = Module()
        registers = self._registers
        m.submodules.line_in = line_in = SerialReceiver(self._timing.divider)
        m.submodules.line_out = line_out = SerialSender(self._timing.divider)
        m.submodules.receiver = receiver = FrameReceiver()
        m.submodules.sender = sender = FrameSender()
        m.submodules.pins = registers
        m.submodules.engine = engine = Engine(registers, self.identity.pack(), self._timing.settle)
        m.submodules.requests = requests = Memory(shape=8, depth=BUFFER, init=[])
        m.submodules.responses = responses = Memory(shape=8, depth=RESPONSES * SLOT, init=[])
        incoming, request = requests.write_port(), requests.read_port()
        stored, sent = responses.write_port(), responses.read_port()
        m.d.comb += [
            line_in.line.eq(self.rx),
            receiver.byte.eq(line_in.byte),
            receiver.valid.eq(line_in.valid),
            receiver.tail.eq(engine.tail),
            incoming.addr.eq(receiver.address),
            incoming.data.eq(receiver.data),
            incoming.en.eq(receiver.write),
            engine.head.eq(receiver.head),
            engine.damaged.eq(receiver.damaged),
            request.addr.eq(engine.place),
            engine.byte.eq(request.data),
            registers.found.eq(self.outputs),
            self.inputs.eq(registers.inputs),
            stored.addr.eq(Cat(engine.address, engine.slot)),
            stored.data.eq(engine.data),
            stored.en.eq(engine.write),
            sent.addr.eq(Cat(sender.address, engine.slot)),
            sender.data.eq(sent.data),
            sender.number.eq(engine.number),
            sender.start.eq(engine.send),
            engine.sending.eq(sender.busy),
            line_out.byte.eq(sender.byte),
            line_out.valid.eq(sender.valid),
            sender.ready.eq(line_out.ready),
            self.tx.eq(line_out.line),
        ]
        return m


assert ceil_log2(SLOT) == 8

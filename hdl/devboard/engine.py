"""The state machine that executes requests."""

from amaranth.hdl import Cat, Module, Mux, Signal, Value
from amaranth.lib.memory import Memory
from amaranth.lib.wiring import Component, In, Out
from amaranth.utils import ceil_log2

from cubestack.firmware_model.interface.devboard import (
    BUFFER,
    OPERATIONS,
    RESPONSES,
    WINDOW,
    Code,
    Status,
    Step,
)
from cubestack.firmware_model.interface.devboard.outputs import room
from cubestack.firmware_model.interface.devboard.table import DAMAGED, END_OF_RECORD
from cubestack.hdl.devboard.pin_registers import PinRegisters

#: Bytes of a stored response, and of those the head: number of records' bytes, status, done.
SLOT, _HEAD = 256, 4

_PLACE = ceil_log2(BUFFER) + 1


class Engine(Component):
    """Takes requests from the ring, executes them and stores their responses.

    Ports:
        head: place after the last request in the ring.
        tail: place of the present request's begin.
        place, byte: the next byte of the request; it follows the place by a clock.
        damaged: high for a clock after each damaged frame.
        slot, address, data, write: a byte of the response.
        send, sending, number: to the sender, which reads the same slot.
    """

    def __init__(self, pins: PinRegisters, identity: bytes, settle: int) -> None:
        super().__init__(
            {
                "head": In(_PLACE),
                "tail": Out(_PLACE),
                "place": Out(_PLACE),
                "byte": In(8),
                "damaged": In(1),
                "slot": Out(range(RESPONSES)),
                "address": Out(8),
                "data": Out(8),
                "write": Out(1),
                "send": Out(1),
                "sending": In(1),
                "number": Out(8),
            }
        )
        self._pins, self._identity, self._settle = pins, identity, settle

    def elaborate(self, platform: object) -> Module:
        m = Module()
        _States(m, self, self._pins, self._identity, self._settle).build()
        return m


class _States:
    """The registers, and the states in the order of a request's way."""

    def __init__(
        self, m: Module, ports: Engine, pins: PinRegisters, identity: bytes, settle: int
    ) -> None:
        self.m, self.ports, self.pins, self.settle = m, ports, pins, settle
        m.submodules.identity = rom = Memory(shape=8, depth=len(identity), init=identity)
        self.identity, self.identity_size = rom.read_port(), len(identity)
        # Of the request.
        self.left = Signal(16)  # bytes that are not taken; of RUN: clocks
        self.fresh, self.take = Signal(), Signal()  # `byte` is the next one; take it
        self.code, self.count = Signal(8), Signal(3)
        self.camera, self.memory = Signal.like(pins.camera), Signal.like(pins.memory)
        self.line, self.pixel = Signal(), Signal(8)
        self.step = Signal(16)
        self.counting = Signal()  # `left` is a number of clocks
        self.wrong = Signal()  # a parameter is out of range
        # Of the response.
        self.size, self.status, self.done = Signal(8), Signal(4), Signal(16)
        # Of the link.
        self.open, self.expected = Signal(), Signal(8)
        self.kept = Signal(range(WINDOW + 1))  # responses since HELLO
        self.ended_early, self.damaged = Signal(), Signal()
        # Of an edge or step.
        self.settling = Signal(range(settle + 1))
        self.rising, self.followed, self.stopped = Signal(), Signal(), Signal()
        self.scan, self.kind = Signal(6), Signal(2)

    def _is(self, *codes: Code) -> Value:
        return Cat(self.code[:3] == code for code in codes).any()

    def _get(self) -> None:
        """Take the request's next byte, which is `fresh`."""
        self.m.d.comb += self.take.eq(1)

    def _put(self, value: Value | int) -> None:
        """Append a byte to the records."""
        self.m.d.comb += [self.ports.write.eq(1), self.ports.data.eq(value)]
        self.m.d.sync += self.size.eq(self.size + 1)

    def _finish(self, status: Status) -> None:
        self.m.d.sync += [self.status.eq(status), self.count.eq(0)]
        self.m.next = "FINISH"

    def build(self) -> None:
        m, pins, ports = self.m, self.pins, self.ports
        clocked = self._is(Code.RUN, Code.STORE, Code.READ)
        m.d.comb += [
            ports.address.eq(self.size + _HEAD),
            pins.camera.eq(self.camera),
            pins.memory.eq(self.memory),
            pins.step.eq(self.step),
            pins.line.eq(self.line),
            pins.value.eq(Mux(self._is(Code.RUN), self.pixel, ports.byte)),
            pins.number.eq(self.scan),
            pins.rising.eq(self.rising),
            pins.reading.eq(self._is(Code.READ)),
            pins.clocked.eq(clocked),
            pins.started.eq(self._is(Code.HELLO)),
        ]
        m.d.sync += self.fresh.eq(~self.take)
        with m.If(self.take):
            m.d.sync += [ports.place.eq(ports.place + 1), self.left.eq(self.left - 1)]
        with m.FSM():
            self._frame()
            self._parameters()
            self._hello()
            self._steps()
            self._clocks()
            self._edge(clocked)
            self._record()
            self._response()
        with m.If(ports.damaged):
            m.d.sync += self.damaged.eq(1)

    def _frame(self) -> None:
        m, ports = self.m, self.ports
        with m.State("IDLE"):
            m.d.sync += [
                self.count.eq(0),
                self.size.eq(0),
                self.done.eq(DAMAGED),
                self.wrong.eq(0),
                self.counting.eq(0),
                self.stopped.eq(0),
                ports.tail.eq(ports.place),
                ports.slot.eq(self.expected),
            ]
            with m.If(ports.place != ports.head):
                m.next = "HEAD"
            with m.Elif(self.damaged):
                m.d.sync += self.left.eq(0)
                m.next = "REFUSE"
        with m.State("HEAD"), m.If(self.fresh):
            self._get()
            m.d.sync += self.count.eq(self.count + 1)
            with m.Switch(self.count):
                with m.Case(0):
                    m.d.sync += self.left.eq(ports.byte)
                with m.Case(1):
                    m.d.sync += self.left.eq(Cat(self.left[:8], ports.byte))
                with m.Case(2):
                    m.d.sync += ports.number.eq(ports.byte)
                with m.Default():
                    m.d.sync += [self.code.eq(ports.byte), self.count.eq(0)]
                    m.next = "DECIDE"
        with m.State("DECIDE"):
            behind = Signal(8)
            m.d.comb += behind.eq(self.expected - ports.number)
            m.d.sync += self.done.eq(ports.number)
            with m.If(self.code[:7] == Code.HELLO):
                m.d.sync += [self.open.eq(1), self.kept.eq(0), self.ended_early.eq(0)]
                m.d.sync += [ports.slot.eq(ports.number), self.done.eq(0)]
                m.next = "LENGTH"
            with m.Elif(~self.open | (behind > self.kept)):
                m.next = "REFUSE"
            with m.Elif(behind != 0):
                m.d.sync += ports.slot.eq(ports.number)
                m.next = "SKIP"
            with m.Else():
                m.d.sync += self.done.eq(0)
                m.next = "LENGTH"
                with m.If(self.ended_early & self.code[7]):
                    self._finish(Status.SKIPPED)
        with m.State("REFUSE"):
            m.d.sync += [ports.number.eq(self.expected), self.damaged.eq(0)]
            self._finish(Status.NAK)
            with m.If(~self.open):
                m.d.sync += self.status.eq(Status.CLOSED)

    def _parameters(self) -> None:
        m, byte = self.m, self.ports.byte
        with m.State("LENGTH"):
            m.d.sync += [self.step.eq(1), self.line.eq(1)]
            self._finish(Status.REJECTED)
            with m.Switch(self.code[:7]):
                for operation in OPERATIONS.values():
                    with m.Case(operation.code):
                        right = self.left == operation.size
                        if operation.data:
                            right = self.left >= operation.size
                        with m.If(right):
                            m.next = "PARAMETERS"
        with m.State("PARAMETERS"), m.If(self.fresh):
            m.d.sync += self.count.eq(self.count + 1)
            with m.Switch(self.code[:3]):
                for operation in OPERATIONS.values():
                    with m.Case(operation.code), m.Switch(self.count):
                        places = [
                            (parameter.name, part)
                            for parameter in operation.parameters
                            for part in range(parameter.size)
                        ]
                        for place, (name, part) in enumerate(places):
                            with m.Case(place):
                                self._get()
                                self._parameter(name, part, byte)
                        with m.Case(len(places)):
                            m.d.sync += self.scan.eq(0)
                            m.next = self._start(operation.code)
            with m.If(self.wrong):
                self._finish(Status.REJECTED)

    def _parameter(self, name: str, part: int, byte: Value) -> None:
        m, lines = self.m, self.pins.lines
        counts = {"camera": len(lines.cameras), "memory": len(lines.memories)}
        if name in counts:
            m.d.sync += getattr(self, name).eq(byte)
            with m.If(byte >= counts[name]):
                m.d.sync += self.wrong.eq(1)
        elif name == "nonce":
            self._put(byte)
        elif name == "clocks" and part:
            m.d.sync += [self.left.eq(Cat(self.left[8:], byte)), self.wrong.eq(byte[7])]
            m.d.sync += self.counting.eq(1)
        elif name == "clocks":
            m.d.sync += self.left[8:].eq(byte)  # stays, as only one byte is left
        else:
            m.d.sync += getattr(self, name)[8 * part : 8 * part + 8].eq(byte)

    @staticmethod
    def _start(code: Code) -> str:
        clocked = (Code.RUN, Code.STORE, Code.READ)
        return "CLOCK" if code in clocked else {Code.STEPS: "STEP"}.get(code, code.name)

    def _hello(self) -> None:
        m, pins = self.m, self.pins
        with m.State("HELLO"):
            m.d.comb += pins.stage_initial.eq(1)
            m.next = "APPLY"
        with m.State("IDENTITY"):
            m.d.comb += self.identity.addr.eq(self.scan)
            m.d.sync += self.count.eq(self.count + 1)
            with m.If(self.count[0]):
                self._put(self.identity.data)
                m.d.sync += self.scan.eq(self.scan + 1)
                with m.If(self.scan == self.identity_size - 1):
                    m.d.sync += self.scan.eq(0)
                    m.next = "OUTPUTS"
        with m.State("OUTPUTS"):
            self._put(pins.found_byte)
            m.d.sync += self.scan.eq(self.scan + 1)
            with m.If(self.scan == pins.out.size - 1):
                m.d.comb += pins.keep.eq(1)
                self._finish(Status.OK)

    def _steps(self) -> None:
        m, pins, byte = self.m, self.pins, self.ports.byte
        with m.State("STEP"), m.If(self.fresh):
            with m.If(self.left < 2):
                self._finish(Status.OK)
            with m.Elif(self.size > room(pins.out.size)):
                self._finish(Status.FULL)
            with m.Else():
                self._get()
                m.d.sync += Cat(self.scan, self.kind).eq(byte)
                m.next = "VALUE"
        with m.State("VALUE"), m.If(self.fresh):
            self._get()
            m.next = "STEP"
            with m.If(self.kind == Step.CHECK >> 6):
                m.d.sync += self.done.eq(self.done + 1)
                with m.If(pins.found_byte != byte):
                    m.d.sync += self.done.eq(self.done)
                    self._finish(Status.CHECK)
            with m.Else():
                m.d.comb += pins.stage_byte.eq(1)
                with m.If(self.kind == Step.SET >> 6):
                    m.next = "APPLY"
                with m.Else():
                    m.d.sync += self.done.eq(self.done + 1)

    def _clocks(self) -> None:
        m, pins = self.m, self.pins
        with m.State("CLOCK"):
            m.d.sync += self.rising.eq(1)
            with m.If(self.left == 0):
                self._finish(Status.OK)
            with m.Elif(self.size > room(pins.out.size)):
                self._finish(Status.FULL)
            with m.Else():
                m.next = "EDGE"
                with m.If(self.counting):
                    m.d.sync += self.left.eq(self.left - 1)
        with m.State("SAMPLE"):
            m.d.comb += pins.stage_sample.eq(1)
            m.next = "PUT"
            with m.If(self._is(Code.STORE)):
                m.d.comb += self.take.eq(self.fresh)
                with m.If(~self.fresh):
                    m.next = "SAMPLE"
        with m.State("PUT"):
            m.d.comb += pins.apply.eq(1)
            m.next = "SETTLE"
        with m.State("EDGE"):
            m.d.comb += [pins.stage_clock.eq(1), pins.aim.eq(self.rising)]
            m.d.sync += self.followed.eq(0)
            m.next = "APPLY"

    def _edge(self, clocked: Value) -> None:
        m, pins = self.m, self.pins
        with m.State("APPLY"):
            m.d.comb += pins.apply.eq(1)
            m.d.sync += self.settling.eq(self.settle)
            m.next = "SETTLE"
            # The camera's lines move after its clock has fallen.
            camera = self._is(Code.RUN, Code.STORE)
            with m.If(camera & ~self.rising & ~self.followed):
                m.next = "SAMPLE"
        with m.State("SETTLE"):
            m.d.sync += self.settling.eq(self.settling - 1)
            with m.If(self.settling == 0):
                m.next = "COMPARE"
                with m.If(clocked & ~self.followed):
                    m.next = "FOLLOW"
                with m.If(self._is(Code.HELLO)):
                    m.d.comb += pins.keep.eq(1)
                    m.d.sync += self.count.eq(0)
                    m.next = "IDENTITY"
        with m.State("FOLLOW"):
            m.d.sync += self.followed.eq(1)
            m.next = "APPLY"
            with m.If(~self._is(Code.READ)):
                m.d.comb += pins.stage_bus.eq(1)
            with m.Elif(self.rising & ~pins.strayed):
                m.d.comb += [pins.stage_memory.eq(1), self.take.eq(1)]
            with m.Else():
                m.next = "COMPARE"
        with m.State("COMPARE"):
            m.next = "NEXT"
            with m.If(pins.different):
                m.d.sync += [self.scan.eq(0), self.count.eq(0)]
                m.next = "RECORD"
            for status, ended in (
                (Status.ADDRESS, self._is(Code.READ) & pins.strayed),
                (Status.READS, ~self._is(Code.READ) & pins.reads),
                (Status.ACKNOWLEDGE, ~self._is(Code.READ) & pins.acknowledged),
            ):
                with m.If(clocked & ended):
                    m.d.sync += [self.stopped.eq(1), self.status.eq(status)]
        with m.State("NEXT"):
            m.d.comb += pins.keep.eq(1)
            m.d.sync += [self.done.eq(self.done + 1), self.count.eq(0)]
            m.next = "STEP"
            with m.If(clocked):
                m.next = "CLOCK"
            with m.If(clocked & self.rising):
                m.d.sync += self.rising.eq(0)
                m.next = "EDGE"
            with m.If(self.stopped):
                m.next = "FINISH"

    def _record(self) -> None:
        m, pins = self.m, self.pins
        with m.State("RECORD"):
            m.d.sync += self.count.eq(self.count + 1)
            self._put(Mux(self.count[0], self.done[8:], self.done[:8]))
            with m.If(self.count[0]):
                m.d.sync += self.count.eq(0)
                m.next = "SCAN"
        with m.State("SCAN"):
            with m.If(self.scan == pins.out.size):
                self._put(END_OF_RECORD)
                m.next = "NEXT"
            with m.Elif(~pins.differs):
                m.d.sync += self.scan.eq(self.scan + 1)
            with m.Else():
                self._put(self.scan)
                m.next = "CHANGED"
        with m.State("CHANGED"):
            self._put(pins.found_byte)
            m.d.sync += self.scan.eq(self.scan + 1)
            m.next = "SCAN"

    def _response(self) -> None:
        m, ports = self.m, self.ports
        with m.State("FINISH"):
            m.d.sync += self.count.eq(self.count + 1)
            m.d.comb += [ports.write.eq(1), ports.address.eq(self.count)]
            with m.Switch(self.count):
                with m.Case(0):
                    m.d.comb += ports.data.eq(self.size)
                with m.Case(1):
                    m.d.comb += ports.data.eq(self.status)
                with m.Case(2):
                    m.d.comb += ports.data.eq(self.done[:8])
                with m.Case(_HEAD - 1):
                    m.d.comb += ports.data.eq(self.done[8:])
                    m.next = "SKIP"
                    with m.If((self.status != Status.NAK) & (self.status != Status.CLOSED)):
                        m.d.sync += self.expected.eq(ports.number + 1)
                        with m.If(self.kept != WINDOW):
                            m.d.sync += self.kept.eq(self.kept + 1)
                        with m.If(self.status != Status.SKIPPED):
                            m.d.sync += self.ended_early.eq(self.status != Status.OK)
        with m.State("SKIP"):
            with m.If((self.left == 0) | self.counting):
                m.next = "SEND"
            with m.Else():
                self._get()
        with m.State("SEND"):
            m.d.comb += ports.send.eq(1)
            m.next = "SENDING"
        with m.State("SENDING"), m.If(~ports.sending):
            m.next = "IDLE"

"""The inputs of a design as registers, and the predicted and found outputs."""

from collections.abc import Iterable

from amaranth.hdl import Array, Cat, Const, Module, Mux, Signal, Value
from amaranth.lib.wiring import Component, In, Out

from cubestack.firmware_model.interface.devboard import Layout, Lines
from cubestack.firmware_model.interface.pins import Pin


def _any(values: Iterable[Value]) -> Value:
    return Cat(*values).any()


class PinRegisters(Component):
    """Registers in front of a design's inputs, and what the host has of its outputs.

    New levels are staged; ``apply`` makes all of them the design's inputs at once. Predictions are
    those of :mod:`cubestack.firmware_model.interface.devboard.outputs`. ``found`` must have settled
    at the clocks with ``keep``, and one clock before a result is used.

    Ports:
        inputs, found: the design's pins, packed.
        stage_byte: stage input byte ``number`` as ``value``.
        stage_initial: stage all initial levels.
        stage_clock: stage ``rising`` as level of the clock.
        stage_sample: stage ``value`` and ``line`` on the camera's pins.
        stage_memory: stage ``value`` on the memory's data input.
        stage_bus: stage each memory's data input as it follows its data output.
        apply: take the staged levels.
        aim: keep the pixel or byte that the edge to come samples.
        keep: take the found outputs as those that the host has.
        clocked: the outputs are those of an edge, ``rising`` or not; otherwise of a step.
        started: with ``keep``: the levels are those after both edges, too.
        reading: the clock is the data clock, and its edges read; otherwise a camera's.
        camera, memory, step: of the operation.
        number: of an output byte; ``found_byte`` and ``differs`` follow it.
        different, acknowledged, reads, strayed: results of a comparison with the prediction; they
            follow by a clock.
    """

    def __init__(self, pins: Iterable[Pin], lines: Lines) -> None:
        pins = tuple(pins)
        self.lines = lines
        self.into, self.out = Layout.inputs(pins), Layout.outputs(pins)
        stages = ("byte", "initial", "clock", "sample", "memory", "bus")
        controls = ("apply", "aim", "keep", "clocked", "started", "reading", "rising", "line")
        results = ("different", "acknowledged", "reads", "strayed")
        super().__init__(
            {
                "inputs": Out(8 * self.into.size, init=self.into.initial),
                "found": In(8 * self.out.size),
                **{f"stage_{stage}": In(1) for stage in stages},
                **dict.fromkeys(controls, In(1)),
                **dict.fromkeys(results, Out(1)),
                "number": In(6),
                "value": In(8),
                "camera": In(range(max(2, len(lines.cameras)))),
                "memory": In(range(max(2, len(lines.memories)))),
                "step": In(16),
                "found_byte": Out(8),
                "differs": Out(1),
            }
        )

    def _of(self, number: Value, name: str) -> Value:
        """The port's bits of packed inputs or outputs."""
        layout = self.into if name in self.into.ports else self.out
        offset = layout.offsets[name]
        return number[offset : offset + layout.ports[name].width]

    def _bits(self, layout: Layout) -> Value:
        """A one for each bit that a port has."""
        return Const(sum((1 << p.width) - 1 << layout.offsets[n] for n, p in layout.ports.items()))

    def elaborate(self, platform: object) -> Module:
        m = Module()
        self._add_inputs(m)
        self._add_outputs(m)
        return m

    def _add_inputs(self, m: Module) -> None:
        staged = Signal.like(self.inputs)
        bits = self._bits(self.into)
        with m.If(self.stage_byte):
            for place in range(self.into.size):
                part = slice(8 * place, 8 * place + 8)
                with m.If(self.number == place):
                    m.d.sync += staged[part].eq(self.value & bits[part])
        with m.If(self.stage_initial):
            m.d.sync += staged.eq(self.into.initial)
        with m.If(self.stage_clock & self.reading):
            m.d.sync += self._of(staged, self.lines.data_clock).eq(self.rising)
        for place, camera in enumerate(self.lines.cameras):
            mine = self.camera == place
            with m.If(self.stage_clock & ~self.reading & mine):
                m.d.sync += self._of(staged, camera.clock).eq(self.rising)
            with m.If(self.stage_sample & mine):
                m.d.sync += [
                    self._of(staged, camera.data).eq(self.value),
                    self._of(staged, camera.line).eq(self.line),
                ]
        for place, memory in enumerate(self.lines.memories):
            with m.If(self.stage_memory & (self.memory == place)):
                m.d.sync += self._of(staged, memory.data_in).eq(self.value)
            with m.If(self.stage_bus):
                driven, level = (self._of(self.found, n) for n in (memory.drives, memory.data_out))
                bus = Mux(driven, level, 0)
                m.d.sync += self._of(staged, memory.data_in).eq(bus)
        with m.If(self.apply):
            m.d.sync += self.inputs.eq(staged)

    def _add_outputs(self, m: Module) -> None:
        lines, found = self.lines, self.found
        known, predicted = Signal.like(found), Signal.like(found)
        values = {lines.data} | {n for x in lines.memories for n in (x.address, x.data_out)}
        levels = [name for name in self.out.ports if name not in values]
        places, width = {}, 0
        for name in levels:
            places[name] = width
            width += self.out.ports[name].width
        after = [Signal(width, name=f"after_{edge}") for edge in ("fall", "rise")]
        found_levels = Cat(self._of(found, name) for name in levels)
        predicted_levels = Cat(self._of(predicted, name) for name in levels)
        sampled, follows = Signal(8), Signal(init=1)
        with m.If(self.aim):
            sources = [self._of(self.inputs, camera.data) for camera in lines.cameras]
            pixel = Array(sources)[self.camera] if len(sources) > 1 else sources[0]
            bytes_ = [self._of(self.inputs, memory.data_in) for memory in lines.memories]
            byte = Array(bytes_)[self.memory] if len(bytes_) > 1 else bytes_[0]
            m.d.sync += sampled.eq(Mux(self.reading, byte, pixel))

        m.d.comb += predicted.eq(known)
        with m.If(self.clocked):
            m.d.comb += predicted_levels.eq(Mux(self.rising, after[1], after[0]))
            with m.If(self.reading & self.rising):
                m.d.comb += self._of(predicted, lines.data).eq(sampled)
        strayed = []
        for place, memory in enumerate(lines.memories):
            drove = after[1][places[memory.drives]]
            mine = self.memory == place
            now = self._of(known, memory.address)
            next_address = Signal.like(now, name=f"next_address_{place}")
            m.d.sync += next_address.eq(now + (self.step & (self.reading | drove).replicate(16)))
            with m.If(self.clocked & self.rising & mine):
                m.d.comb += self._of(predicted, memory.address).eq(next_address)
                with m.If(~self.reading & follows):
                    m.d.comb += self._of(predicted, memory.data_out).eq(sampled)
            other = self._of(found, memory.address) != self._of(predicted, memory.address)
            strayed.append(other & mine)
        m.d.sync += [
            self.strayed.eq(_any(strayed)),
            self.acknowledged.eq(
                _any(self._of(found, n) != self._of(known, n) for n in lines.acknowledges)
            ),
            self.reads.eq(
                _any(
                    ~self._of(found, x.ce_n) & ~self._of(found, x.oe_n) & self._of(found, x.we_n)
                    for x in lines.memories
                )
            ),
        ]
        parts = [slice(8 * place, 8 * place + 8) for place in range(self.out.size)]
        different = Signal(self.out.size)
        m.d.sync += different.eq(Cat(found[part] != predicted[part] for part in parts))
        m.d.comb += self.different.eq(different.any())
        with m.Switch(self.number):
            for place, part in enumerate(parts):
                with m.Case(place):
                    m.d.comb += [self.found_byte.eq(found[part]), self.differs.eq(different[place])]
        following = [
            (self._of(found, memory.data_out) == sampled) & (self.memory == place)
            for place, memory in enumerate(lines.memories)
        ]
        with m.If(self.keep):
            m.d.sync += known.eq(found)
            with m.If(self.started):
                m.d.sync += follows.eq(1)
            with m.Elif(self.clocked & self.rising & ~self.reading):
                m.d.sync += follows.eq(_any(following))
            for edge in (0, 1):
                with m.If(self.started | (self.clocked & (self.rising == edge))):
                    m.d.sync += after[edge].eq(found_levels)

"""The engine whose design runs on a development board; cameras and memories are emulated.

A change of a pin costs one round trip on the line. Rows of pixels and of read-out are one request
each, of which several are on their way at once; see :mod:`firmware_model.interface.devboard`.
"""

from collections.abc import Iterator, Sequence
from fractions import Fraction
from logging import INFO, WARNING, getLogger
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.rtl.contract import BurstEnd
from cubestack.emulator.rtl.devboard.channel import DevboardError
from cubestack.emulator.rtl.devboard.lines import lines_of
from cubestack.emulator.rtl.devboard.link import Link, Request
from cubestack.emulator.rtl.pixel_clock import LoadedSegment
from cubestack.emulator.rtl.sram import SramPins, SramTiming
from cubestack.emulator.rtl.stepped import SteppedEngine, Stream
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.firmware_model.interface.devboard import (
    OPERATIONS,
    Code,
    Layout,
    Outputs,
    ProtocolError,
    Response,
    Status,
    Step,
    decode_deviations,
)
from cubestack.firmware_model.interface.devboard.outputs import apply_deviation
from cubestack.firmware_model.interface.devboard.table import MOST_EDGES

_log = getLogger(__name__)

_READ = 1024
"""Bytes of the memory in one request."""

_STEADY = 2
"""Clocks without a deviation after which the following ones are alike."""


class _Clocks(NamedTuple):
    """Clocks of a camera in one request: RUN, or STORE with a pixel each."""

    first: int  #: number of the first sample
    clocks: int
    line: int
    pixels: bytes  #: put at each falling edge
    low_clocks: int  #: clocks in a row with the line pin low, after them


class DevboardEngine(SteppedEngine):
    """Owns ``link``, which is open; ``outputs`` are those at HELLO.

    It has no access to registers of the design.
    """

    def __init__(
        self,
        wiring: Wiring,
        link: Link,
        outputs: bytes,
        sram_timing: SramTiming | None = None,
        *,
        skipping: bool = True,
    ) -> None:
        super().__init__(wiring, sram_timing, skipping=skipping)
        self.link = link
        self._lines = lines_of(wiring)
        self._inputs = Layout.inputs(wiring.component.pins)
        self._wanted = self._board = self._inputs.initial
        packed = int.from_bytes(outputs, "little")
        self._outputs = Outputs(Layout.outputs(wiring.component.pins), self._lines, packed)
        self._stored_in = [0] * len(wiring.cameras)  # number of the memory, by camera
        self._step = self._odd_step = 1  # of the address per data clock; one that differed
        self._absorbing = False
        self._settle(0)

    def close(self) -> None:
        self.link.close()
        counters = self.link.counters
        text = "board on %s: %d frames, %d repeated; %d bytes sent, %d received"
        numbers = counters.frames, counters.repeated, counters.sent, counters.received
        _log.log(WARNING if counters.repeated else INFO, text, self.link.name, *numbers)

    # --- single pins ------------------------------------------------------------------------------

    def _get(self, name: str) -> int:
        if name in self._inputs.ports:
            return self._inputs.get(self._wanted, name)
        self._flush()
        return self._outputs.layout.get(self._outputs.now, name)

    def _put(self, name: str, value: int) -> None:
        self._wanted = self._inputs.put(self._wanted, name, value)

    def _drive(self, time_ps: int, name: str, value: int) -> None:
        self._flush()  # what a clock samples changes before it
        super()._drive(time_ps, name, value)

    def _settle(self, time_ps: int) -> None:
        self._flush()
        super()._settle(time_ps)
        self._flush()

    def _flush(self) -> None:
        """Change the board's inputs that differ, together."""
        different = self._wanted ^ self._board
        if not different or self._absorbing:
            return
        steps = bytearray()
        for number in range(self._inputs.size):
            if different >> 8 * number & 0xFF:
                steps += bytes([Step.STAGE | number, self._wanted >> 8 * number & 0xFF])
        steps[-2] = Step.SET | steps[-2] & ~Step.STAGE
        response = self.link.request(Code.STEPS, OPERATIONS[Code.STEPS].request(bytes(steps)))
        self._check(response, Status.OK)
        self._board = self._wanted
        for deviation in decode_deviations(response.records):
            self._outputs.now = apply_deviation(self._outputs.now, deviation)

    def _check(self, response: Response, *expected: Status) -> None:
        if response.status not in expected:
            status = response.status
            raise DevboardError(f"the board on {self.link.name} {status.meaning} ({status.name})")

    # --- pixels -----------------------------------------------------------------------------------

    def _burst(self, until_ps: int, cameras: Sequence[int]) -> tuple[int, BurstEnd, int]:
        if len(cameras) != 1:
            return super()._burst(until_ps, cameras)
        (camera,) = cameras
        stream = self._streams[camera]
        loaded = stream.loaded
        assert loaded is not None
        before = self._acknowledges()
        while True:
            time_ps = stream.time_ps
            if time_ps > until_ps:
                return until_ps, BurstEnd.TIME_REACHED, camera
            # Whole clocks in reach, from a low clock on.
            clocks = loaded.first_edge(until_ps + 1) // 2 - stream.edge // 2
            if stream.edge % 2 or clocks < 1 or self._reading() is not None:
                self._run_edge(stream, loaded, time_ps, until_ps)
            else:
                time_ps = self._run_clocks(camera, stream, loaded, clocks)
            changed = self._acknowledges() != before
            if changed or stream.edge == loaded.edges:
                self._go_back(stream, time_ps, False)
                end = BurstEnd.ACKNOWLEDGE_CHANGED if changed else BurstEnd.SEGMENT_OVER
                return time_ps, end, camera

    def _reading(self) -> int | None:
        """Number of a memory that drives its bus."""
        for number, sram in enumerate(self._srams):
            if sram.reads:
                return number
        return None

    def _run_clocks(self, camera: int, stream: Stream, loaded: LoadedSegment, clocks: int) -> int:
        """Run up to ``clocks`` whole clocks; returns the time of the last edge."""
        self._flush()
        planned: list[_Clocks] = []

        def requests() -> Iterator[Request]:
            for part in self._plan(stream, loaded, stream.edge // 2 + clocks):
                planned.append(part)
                numbers = {"camera": camera, "memory": self._stored_in[camera]}
                if part.pixels:
                    payload = OPERATIONS[Code.STORE].request(part.pixels, **numbers)
                    yield Request(Code.STORE, payload, len(planned) > 1)
                else:
                    numbers |= {"line": part.line, "pixel": 0, "clocks": part.clocks}
                    payload = OPERATIONS[Code.RUN].request(b"", **numbers)
                    yield Request(Code.RUN, payload, len(planned) > 1)

        edge = stream.edge
        for number, response in enumerate(self.link.exchange(requests())):
            self._check(response, Status.OK, Status.ACKNOWLEDGE, Status.READS, Status.FULL)
            edge = self._absorb_clocks(camera, stream, loaded, planned[number], response)
        return loaded.time_of(edge)

    def _plan(self, stream: Stream, loaded: LoadedSegment, end: int) -> Iterator[_Clocks]:
        """Requests for the samples from the present one to before ``end``; skips low ones."""
        sample, low_clocks = stream.edge // 2, stream.low_clocks
        most = min(self.link.limit - 16, MOST_EDGES // 2)
        while sample < end:
            low = not loaded.sample(sample)[0]
            if self._skipping and low and low_clocks >= self._settling_clocks:
                # Continue with the last sample of this low run that is in reach.
                sample = min(loaded.low_until(sample), end) - 1
            following = min(sample + 1, loaded.segment.clocks - 1)
            if loaded.sample(following)[0]:
                row, column = divmod(following, loaded.line_clocks)
                count = min(loaded.active_columns - column, end - sample, most)
                if following == sample:
                    count = 1  # the last one of the segment stays
                low_clocks = low_clocks + 1 if low and count == 1 else 0
                pixels = self._pixels(loaded, row, column, count)
                yield _Clocks(sample, count, 1, pixels, low_clocks)
            else:
                low_end = loaded.low_until(following)
                last = low_end if low_end == loaded.segment.clocks else low_end - 1
                count = min(last, end, sample + MOST_EDGES // 2) - sample
                if self._skipping:
                    needed = self._settling_clocks - (low_clocks if low else -1)
                    count = min(count, max(1, needed))
                low_clocks = low_clocks + count if low else count - 1
                yield _Clocks(sample, count, 0, b"", low_clocks)
            sample += count

    @staticmethod
    def _pixels(loaded: LoadedSegment, row: int, column: int, count: int) -> bytes:
        if loaded.pixels is None:
            return bytes(count)
        return loaded.pixels[row, column : column + count].tobytes()

    def _absorb_clocks(
        self, camera: int, stream: Stream, loaded: LoadedSegment, part: _Clocks, response: Response
    ) -> int:
        """Repeat what the board did, with the memories; returns the number of the last edge."""
        ports, memory = self._lines.cameras[camera], self._stored_in[camera]
        records = _Records(response)
        first, number = 2 * part.first, 0
        while number < response.done:
            rising = number % 2 == 0
            if rising and (clocks := records.alike(number)):
                number += 2 * self._skip_clocks(loaded, part, number // 2, clocks, camera, memory)
            level = self._inputs.get(self._wanted, ports.data)
            outputs = self._outputs
            predicted = outputs.predict_store(memory, level) if rising else outputs.predict(False)
            outputs.edge(rising, records.found(number, predicted))
            self._put(ports.clock, int(rising))
            if not rising:
                self._put(ports.line, part.line)
                self._put(ports.data, part.pixels[number // 2] if part.pixels else 0)
            self._absorb(loaded.time_of(first + number))
            number += 1
        self._board = self._wanted
        for place, own in enumerate(self._lines.memories):
            drives = self._level(own.drives)
            byte = self._level(own.data_out) if drives else 0
            self._board = self._inputs.put(self._board, own.data_in, byte)
            if drives and not self._level(own.ce_n):
                self._stored_in[camera] = place
        stream.edge = first + response.done
        whole = response.done == 2 * part.clocks
        stream.low_clocks = part.low_clocks if whole else 0
        return stream.edge - 1

    def _level(self, name: str) -> int:
        return self._outputs.layout.get(self._outputs.now, name)

    def _absorb(self, time_ps: int) -> None:
        """The memories follow the outputs, which the board has settled already."""
        self._absorbing = True
        try:
            super()._settle(time_ps)
        finally:
            self._absorbing = False

    def _skip_clocks(
        self,
        loaded: LoadedSegment,
        part: _Clocks,
        clock: int,
        clocks: int,
        camera: int,
        memory: int,
    ) -> int:
        """Absorb clocks that only store the next pixel at the next address, or change nothing.

        Returns their number, less than ``clocks``; 0 if there are others among them.
        """
        count = clocks - 1
        levels = [self._phase(rising) for rising in (False, True)]
        if count < 1 or any(phase.reads for phase in (*levels[0], *levels[1])):
            return 0
        writes = [number for number, phase in enumerate(levels[0]) if phase.writes]
        if any(phase.writes for phase in levels[1]) or writes not in ([], [memory]):
            return 0
        own = self._lines.memories[memory]
        data, now = self._lines.cameras[camera].data, self._outputs.now
        pixels = part.pixels[clock : clock + count] if part.pixels else bytes(count)
        # The n-th clock's rising edge takes what was put at the falling edge before.
        taken = bytes([self._inputs.get(self._wanted, data)]) + pixels[:-1]
        layout, sram = self._outputs.layout, self._srams[memory]
        stored = layout.get(self._outputs.after[True], own.drives) & 1
        address = layout.get(now, own.address)
        if writes:
            least = loaded.half_period - 1
            timing = sram.timing
            if least < timing.write_pulse_ps or 2 * least < timing.data_setup_ps or not stored:
                return 0
            if not (levels[0][memory].data is not None and levels[1][memory].data is not None):
                return 0
            # Also the last byte, whose pulse ends with the next edge, which has been run too.
            content = np.frombuffer(bytes([layout.get(now, own.data_out)]) + taken, np.uint8)
            places = (address + np.arange(count + 1)) % len(sram.memory)
            if sram.powered:
                sram.memory[places] = content
        now = layout.put(self._outputs.predict(False), own.address, address + stored * count)
        self._outputs.now = layout.put(now, own.data_out, taken[-1])
        self._put(data, pixels[-1])
        return count

    def _phase(self, rising: bool) -> list[SramPins]:
        """The memories' strobes after edges of one direction; addresses and data are not those."""
        layout, levels = self._outputs.layout, self._outputs.after[rising]
        return [
            SramPins(
                0,
                layout.get(levels, own.ce_n),
                layout.get(levels, own.oe_n),
                layout.get(levels, own.we_n),
                0 if layout.get(levels, own.drives) else None,
            )
            for own in self._lines.memories
        ]

    # --- read-out ---------------------------------------------------------------------------------

    def _strobe(self, out: NDArray[np.uint8], period: Fraction, fraction: Fraction) -> None:
        done = 0
        while done < len(out):
            memory = self._reading()
            if memory is None or self._get(self.wiring.data_clock):
                self._strobe_clock(out, done, period, fraction)
                done += 1
            else:
                done = self._read_clocks(memory, out, done, period, fraction)

    def _read_clocks(
        self, memory: int, out: NDArray[np.uint8], first: int, period: Fraction, fraction: Fraction
    ) -> int:
        """Run data clocks from number ``first`` on while the address counts; the next number."""
        self._flush()
        address, step = self._level(self._lines.memories[memory].address), self._step
        sram = self._srams[memory]
        sent: list[bytes] = []

        def requests() -> Iterator[Request]:
            position = first
            while position < len(out):
                count = min(len(out) - position, self.link.limit - 16, _READ)
                places = address + step * (position - first + 1 + np.arange(count))
                content = sram.memory[places % len(sram.memory)]
                sent.append(content.tobytes() if sram.powered else bytes(count))
                payload = OPERATIONS[Code.READ].request(sent[-1], memory=memory, step=step)
                yield Request(Code.READ, payload, position > first)
                position += count

        done = first
        for number, response in enumerate(self.link.exchange(requests())):
            self._check(response, Status.OK, Status.ADDRESS, Status.FULL)
            part = sent[number], response
            done = self._absorb_reads(memory, out, done, *part, period, fraction)
        if self._inputs.get(self._wanted, self.wiring.data_clock):
            # The address was not the predicted one, so the board lacks the memory's byte.
            out[done] = self._get(self.wiring.data)
            half = int(fraction + (done + Fraction(1, 2)) * period)
            self._drive(self.now_ps + half, self.wiring.data_clock, 0)
            done += 1
        return done

    def _absorb_reads(
        self,
        memory: int,
        out: NDArray[np.uint8],
        first: int,
        content: bytes,
        response: Response,
        period: Fraction,
        fraction: Fraction,
    ) -> int:
        """Repeat what the board did, from data clock ``first`` on; returns the next clock."""
        own, outputs, clock = self._lines.memories[memory], self._outputs, self.wiring.data_clock
        records, number = _Records(response), 0
        begin = self.now_ps

        def time_of(edge: int) -> int:
            return begin + int(fraction + (first + Fraction(edge, 2)) * period)

        while number < response.done:
            rising = number % 2 == 0
            if rising and (clocks := records.alike(number)):
                number += 2 * self._skip_reads(
                    memory, out, first, content, number // 2, clocks, period
                )
            offered = self._inputs.get(self._wanted, own.data_in)
            before = self._level(own.address)
            if rising:
                for sram in self._srams:
                    sram.sample(time_of(number))
                predicted = outputs.predict_read(memory, self._step, offered)
            else:
                predicted = outputs.predict(False)
            outputs.edge(rising, records.found(number, predicted))
            self._put(clock, int(rising))
            self._board = self._inputs.put(self._wanted, own.data_in, offered)
            if rising and response.status is Status.ADDRESS and number + 1 == response.done:
                self._learn_step(self._level(own.address) - before)
            elif rising:
                self._board = self._inputs.put(self._board, own.data_in, content[number // 2])
            self._absorb(time_of(number))
            if rising:
                out[first + number // 2] = self._level(self.wiring.data)
            number += 1
        return first + number // 2

    def _learn_step(self, step: int) -> None:
        """Expect the step that was found twice in a row where another one was expected."""
        self._step = step if step == self._odd_step and step >= 0 else self._step
        self._odd_step = step

    def _skip_reads(
        self,
        memory: int,
        out: NDArray[np.uint8],
        first: int,
        content: bytes,
        clock: int,
        clocks: int,
        period: Fraction,
    ) -> int:
        """Absorb clocks that only read the next byte; returns their number, 0 to ``clocks`` - 1."""
        own, count = self._lines.memories[memory], clocks - 1
        sram, layout = self._srams[memory], self._outputs.layout
        reads = [[phase.reads for phase in self._phase(rising)] for rising in (False, True)]
        alone = [number == memory for number in range(len(self._srams))]
        enough = period - 1 >= max(sram.timing.access_ps, sram.timing.output_enable_ps)
        if count < 1 or reads != [alone, alone] or not enough or not self._step:
            return 0
        taken = bytes([self._inputs.get(self._wanted, own.data_in)])
        taken += content[clock : clock + count - 1]
        out[first + clock : first + clock + count] = np.frombuffer(taken, np.uint8)
        address = layout.get(self._outputs.now, own.address) + self._step * count
        now = layout.put(self._outputs.predict(False), own.address, address)
        self._outputs.now = layout.put(now, self._lines.data, taken[-1])
        self._put(own.data_in, content[clock + count - 1])
        return count


class _Records:
    """The deviations of a response by position."""

    def __init__(self, response: Response) -> None:
        try:
            self._found = {d.position: d for d in decode_deviations(response.records)}
        except ProtocolError as error:
            raise DevboardError(f"the board sent a wrong response: {error}") from None
        self._positions = [*sorted(self._found), response.done]

    def found(self, position: int, predicted: int) -> int:
        """The outputs after an edge."""
        deviation = self._found.get(position)
        return predicted if deviation is None else apply_deviation(predicted, deviation)

    def alike(self, position: int) -> int:
        """Clocks from ``position`` on without a deviation, if those before have none either."""
        if any(position - 2 * _STEADY <= place < position for place in self._found):
            return 0
        following = next(place for place in self._positions if place >= position)
        return (following - position) // 2 if position >= 2 * _STEADY else 0

"""Images and read-outs: commands to the FPGAs, the wait for ACK, bytes over the data lines.

CubeSense thesis, tables 6.3 and 6.4, sections 6.4.2, 6.5.1 and 6.6.2. The control lines are set in
standby and the enables follow; standby separates any two commands. A camera's image is stored in
its own memory, or over the FPGAs' link in the other one; edge data return the same way.

With address control from the microcontroller (section 9.2.2) single pixels can be read, but only
from the memory of the enabled FPGA.

FPGAs with one search each send the whole image over the link, row by row, where the others send
edge data. The program discards what it does not need, and has the image sent again for each column,
because it has no room for ten of them; assumed, because no program for it is printed.
"""

from collections.abc import Generator, Iterable
from itertools import islice, pairwise

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubesense.hardware import CubeSenseHardware
from cubestack.firmware_model.cubesense.supply import SAMPLE_US, Supply
from cubestack.firmware_model.cubesense.vision.edges import EdgeList, NadirLines
from cubestack.firmware_model.cubesense.vision.sun_centroid import COORDINATE_BYTES, window_bytes
from cubestack.firmware_model.interface.cubesense import codes, fpga, pins
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import AwaitPin, ReadTimer, Routine, SetPin, StrobeRead

ACK_POLL_CYCLES = 9  #: port read (2) and loop step (7) of the cost table

#: Longer than ACK can take, two frames of 33.37 ms less the gap between them: assumed.
ACK_TIMEOUT_US = 70_000

CHUNK = fpga.FULL_SIZE.scan_step  #: largest piece of an image in bytes: the scan's buffer
SAMPLE_BYTES = fpga.FULL_SIZE.columns  #: bytes between two readings of the supply currents
SAMPLE_PIXELS = 64  #: the same for pixels that are addressed one by one

#: Target of bytes that are clocked and discarded; it takes none of the part's memory.
_DISCARDED = np.zeros(SAMPLE_BYTES, np.uint8)

_ROWS = {command.actions: command for command in fpga.COMMANDS + fpga.ADDRESSING_COMMANDS}


def _actions(
    half: codes.Camera | codes.Sram, action: fpga.Action, other: fpga.Action = fpga.Action.STANDBY
) -> fpga.Actions:
    """``action`` for one half's FPGA and ``other`` for the other one."""
    return fpga.Actions(action, other) if half == codes.Camera.SUN else fpga.Actions(other, action)


class Acquisition:
    """The pins that both FPGAs share with the program, and its buffers for their bytes."""

    def __init__(
        self,
        hardware: CubeSenseHardware,
        meter: Meter,
        supply: Supply,
        read_out: fpga.ReadOut = fpga.FULL_SIZE,
    ) -> None:
        """Both FPGAs are in standby, as at reset; ``read_out`` is theirs."""
        self._read_out = read_out
        self._mcu_addressing = hardware.mcu_addressing
        self._meter = meter
        self._supply = supply
        self._window = np.zeros(window_bytes(), np.uint8)
        self._buffer = self._window[:CHUNK]  # shared: never in use at the same time
        self._strobe_cycles = meter.table.operations["strobe_byte"].cycles
        self._scan_cycles = meter.table.operations["scan_byte"].cycles
        self._open: codes.Sram | None = None
        self._position = 0
        self._unwatched = 0

    @property
    def buffers(self) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """For scanned pixels (64,), a part of the Sun window's (229,)."""
        return self._buffer, self._window

    def can_address(self, camera: codes.Camera, sram: codes.Sram) -> bool:
        """Whether the program can address single pixels of ``camera``'s image."""
        return self._mcu_addressing and sram is codes.Sram(camera)

    def store(self, camera: codes.Camera, sram: codes.Sram) -> Routine[codes.CaptureResult]:
        """Store the next whole image of ``camera``; on failure ``sram`` keeps its contents."""
        if not self._supply.available(sram):
            return codes.CaptureResult.SRAM_OVER_CURRENT
        own = sram is codes.Sram(camera)
        doing = [fpga.Action.STORE] if own else [fpga.Action.SEND_PICTURE, fpga.Action.STORE_OTHER]
        yield from self._enter(_actions(camera, *doing))
        stored = yield from self._await_ack(sram)
        yield from self._standby()
        if not self._supply.available(sram):
            return codes.CaptureResult.SRAM_OVER_CURRENT
        if not stored:
            return codes.CaptureResult.CAMERA_TIMEOUT
        return codes.CaptureResult.STORED_OWN_SRAM if own else codes.CaptureResult.STORED_OTHER_SRAM

    def edge_data(self, camera: codes.Camera, sram: codes.Sram) -> fpga.ReadOut:
        """Read-out of `scan` and `window` for ``camera``'s image in ``sram``."""
        return fpga.FULL_SIZE if self._picks(camera, sram) else self._read_out

    def _picks(self, camera: codes.Camera, sram: codes.Sram) -> bool:
        """Whether the program must pick the edge data out of a whole image."""
        return self._read_out.one_search and sram is not codes.Sram(camera)

    def scan(self, sram: codes.Sram, lines: NadirLines) -> Routine[bool]:
        """Pass the nadir image in ``sram`` to ``lines``; False if the memory was cut off."""
        if self._picks(codes.Camera.NADIR, sram):
            return (yield from self._pick_scan(sram, lines))
        yield from self._enter_edge(codes.Camera.NADIR, sram)
        read = 0
        while lines.wanted and self._supply.available(sram):
            space = lines.space
            yield StrobeRead(space, self._scan_cycles)
            lines.filled()
            read += len(space)
            if read >= SAMPLE_BYTES:
                read = 0
                yield from self._supply.sample()
        yield from self._standby()
        return self._supply.available(sram)

    def window(self, sram: codes.Sram) -> Routine[NDArray[np.uint8] | None]:
        """The Sun window's bytes (229,) in ``sram``, valid until the next call, or None."""
        if self._picks(codes.Camera.SUN, sram):
            yield from self._pick_window(sram)
        else:
            yield from self._enter_edge(codes.Camera.SUN, sram)
            yield StrobeRead(self._window, self._strobe_cycles)
            yield from self._supply.sample()
        yield from self._standby()
        return self._window if self._supply.available(sram) else None

    # --- images over the link -------------------------------------------------------------------

    def _pick_scan(self, sram: codes.Sram, lines: NadirLines) -> Routine[bool]:
        """Like `scan`; the presets are any pixel."""
        size = fpga.FULL_SIZE
        places = (at[0] + at[1] * size.columns if at else 0 for at in size.scan())
        while lines.wanted and self._supply.available(sram):
            space = lines.space
            wanted = np.fromiter(islice(places, len(space)), int)
            yield from self._pick(codes.Camera.NADIR, sram, wanted, space)
            lines.filled()
        yield from self._standby()
        return self._supply.available(sram)

    def _pick_window(self, sram: codes.Sram) -> Routine[None]:
        """The coordinates are in the sun's FPGA, whichever memory holds the image."""
        size, sun = fpga.FULL_SIZE, codes.Camera.SUN
        yield from self._enter_edge(sun, codes.Sram(sun))
        coordinates, pixels = np.split(self._window, [COORDINATE_BYTES])
        yield StrobeRead(coordinates, self._strobe_cycles)
        yield from self._standby()
        x_low, x_high, y_low, y_high = (int(byte) for byte in coordinates)
        left, top = size.window_origin(x_low + 256 * x_high, y_low + 256 * y_high)
        rows, columns = np.mgrid[top : top + size.window, left : left + size.window]
        yield from self._pick(sun, sram, (rows * size.columns + columns).ravel(), pixels)

    def _pick(
        self,
        camera: codes.Camera,
        sram: codes.Sram,
        wanted: NDArray[np.int64],
        target: NDArray[np.uint8],
    ) -> Routine[None]:
        """Read pixels ``wanted`` (n,), counted row by row, into ``target`` (n,)."""
        starts = [0, *(np.flatnonzero(np.diff(wanted) != 1) + 1), len(wanted)]
        for start, end in pairwise(starts):
            if self._open is None or wanted[start] < self._position:
                yield from self._enter_edge(camera, sram)
                self._open, self._position, self._unwatched = sram, 0, 0
            skipped = int(wanted[start]) - self._position
            chunks = (_DISCARDED[: skipped - at] for at in range(0, skipped, SAMPLE_BYTES))
            yield from self._strobe(chunks, self._strobe_cycles)
            yield from self._strobe([target[start:end]], self._scan_cycles)

    # --- images in sequence ---------------------------------------------------------------------

    @property
    def image_open(self) -> bool:
        """Whether the FPGA still presents the image of ``open_image``, where reading ended."""
        return self._open is not None and self._supply.available(self._open)

    def open_image(self, sram: codes.Sram) -> Routine[bool]:
        """Go to the first pixel of the image in ``sram``; False if the memory is off."""
        if not self._supply.available(sram):
            return False
        if self._mcu_addressing:
            yield from self._enter(_actions(sram, fpga.Action.TAKE_ADDRESS))
            yield from self._send_address(0)
        else:
            yield from self._enter(_actions(sram, fpga.Action.READ))
        self._open, self._position, self._unwatched = sram, 0, 0
        return True

    def read_bytes(self, target: NDArray[np.uint8]) -> Routine[None]:
        chunks = (target[at : at + CHUNK] for at in range(0, len(target), CHUNK))
        yield from self._strobe(chunks, self._scan_cycles)

    def skip_bytes(self, count: int) -> Routine[None]:
        """Skip ``count`` bytes: at once if the program can set the address, else clocked."""
        if self._mcu_addressing and count > fpga.ADDRESS_BYTES and self.image_open:
            self._position += count
            yield SetPin(pins.SHIFT, 0)
            yield from self._send_address(self._position % codes.IMAGE_BYTES)
            return
        chunks = (self._buffer[: count - at] for at in range(0, count, CHUNK))
        yield from self._strobe(chunks, self._strobe_cycles)

    def mean(self, sram: codes.Sram) -> Routine[int | None]:
        """Mean of all pixels of the image in ``sram``, rounded down; None as for ``window``.

        Equation 4.1.1. Assumed: a sum of 32 bits, in two additions of 16.
        """
        total = 0
        yield from self.open_image(sram)
        for _ in range(codes.IMAGE_BYTES // CHUNK):
            yield from self.read_bytes(self._buffer)
            total += int(self._buffer.sum(dtype=int))
            self._meter.charge(i16_add=2 * CHUNK)
        self._meter.charge(i16_div=2)
        whole = self.image_open
        yield from self._standby()
        return total // codes.IMAGE_BYTES if whole else None

    def _strobe(self, chunks: Iterable[NDArray[np.uint8]], cycles: int) -> Routine[None]:
        """Clock bytes into ``chunks``, and check the supply currents from time to time."""
        for chunk in chunks:
            if not self.image_open:
                return
            yield StrobeRead(chunk, cycles)
            self._position += len(chunk)
            self._unwatched += len(chunk)
            if self._unwatched >= SAMPLE_BYTES:
                self._unwatched = 0
                yield from self._supply.sample()

    # --- single pixels --------------------------------------------------------------------------

    def answer(
        self, sram: codes.Sram, search: Generator[tuple[int, int], int, EdgeList]
    ) -> Routine[tuple[EdgeList, int] | None]:
        """Read the pixels that ``search`` requests from the image in ``sram``.

        Returns its result and the number of pixels read; None as for ``scan``. Only for FPGAs that
        ``can_address``.
        """
        yield from self._enter(_actions(sram, fpga.Action.TAKE_ADDRESS))
        pixels, pixel = 0, self._buffer[:1]
        found: EdgeList | None = None
        try:
            x, y = next(search)
            while self._supply.available(sram):
                yield from self._send_address(y * fpga.FULL_SIZE.columns + x)
                yield StrobeRead(pixel, self._strobe_cycles)
                yield SetPin(pins.SHIFT, 0)
                pixels += 1
                if pixels % SAMPLE_PIXELS == 0:
                    yield from self._supply.sample()
                x, y = search.send(int(pixel[0]))
        except StopIteration as end:
            found = end.value
        yield from self._standby()
        if found is None or not self._supply.available(sram):
            return None
        return found, pixels

    def _send_address(self, pixel: int) -> Routine[None]:
        """Send a pixel's address to the FPGA; before it answers, the data lines become inputs."""
        y, x = divmod(pixel, fpga.FULL_SIZE.columns)
        self._meter.charge(address_byte=1, port_write=2)
        for byte in fpga.address_bytes(x, y):
            yield SetPin(pins.DATA_I, byte)
            yield SetPin(pins.CLK, 1)
            yield SetPin(pins.CLK, 0)
        yield SetPin(pins.SHIFT, 1)

    def _await_ack(self, sram: codes.Sram) -> Routine[bool]:
        """Whether ACK came in time; returns at once if the memory is cut off."""
        now_us: int = yield ReadTimer()
        deadline_us = now_us + ACK_TIMEOUT_US
        stored = False
        while not stored and now_us < deadline_us and self._supply.available(sram):
            timeout_us = min(SAMPLE_US, deadline_us - now_us)
            stored = yield AwaitPin(pins.ACKNOWLEDGE[sram], 1, timeout_us, ACK_POLL_CYCLES)
            yield from self._supply.sample()
            now_us = yield ReadTimer()
        return stored

    def _enter_edge(self, camera: codes.Camera, sram: codes.Sram) -> Routine[None]:
        own = sram is codes.Sram(camera)
        doing = [fpga.Action.EDGE] if own else [fpga.Action.PASS_EDGE, fpga.Action.SEND_EDGE]
        yield from self._enter(_actions(camera, *doing))

    def _enter(self, wanted: fpga.Actions) -> Routine[None]:
        """Go through standby to the command with the actions ``wanted``."""
        if self._open is not None:
            yield from self._standby()
        row = _ROWS[wanted]
        self._meter.charge(call=1)
        for pin, level in ((pins.SHIFT, row.shift), (pins.EDGE, row.edge), (pins.RNW, row.rnw)):
            assert level is not None
            yield SetPin(pin, level)
        for pin, level in zip(pins.ENABLE, (row.sunen, row.naden), strict=True):
            if not level:
                yield SetPin(pin, 0)

    def _standby(self) -> Routine[None]:
        self._open = None
        for pin in pins.ENABLE:
            yield SetPin(pin, 1)

"""Pictures in memories behind the FPGA, which the program reaches over its external bus.

CubeStar thesis, options 2 and 3 of section 3.3, and section 7.2. Nothing is copied. Pins and
addresses are those of ``docs/gateware-cubestar-next.md``; assumed, as none of it was built. Visited
pixels are zeroed and written back over the bus.
"""

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.detection import (
    Detection,
    DetectionConfig,
    Look,
    search_stars,
)
from cubestack.firmware_model.cubestar.hardware import CubeStarHardware
from cubestack.firmware_model.cubestar.pictures.contract import ITERATION_US, Pictures, test_pattern
from cubestack.firmware_model.cubestar.pictures.copied import CopiedPictures
from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.cubestar.supply import SupplyMonitor
from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS
from cubestack.firmware_model.interface.cubestar import IMAGE_BYTES
from cubestack.firmware_model.interface.cubestar.layouts import Layout
from cubestack.firmware_model.interface.cubestar.pins import (
    ACK,
    BANK,
    BOARD_PREFIXES,
    ENABLE,
    INTO,
    RNW,
)
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import BusAccess, Routine, SetPin

FAST_ITERATION_US = 500_000


class _BusPictures(Pictures):
    """What these layouts share.

    A place is where a picture can be; ``Retained.image_place`` has that of the newest one.
    """

    acknowledge: str = ACK
    while_storing = True
    iteration_us = FAST_ITERATION_US
    memories: tuple[tuple[int, int, int], ...] = ((0, 0, 2 * IMAGE_BYTES),)
    """Chip select, first address and size of each memory."""

    _open = False
    """Whether the bus leads to the newest picture."""

    def _address_of(self, place: int) -> tuple[int, int]:
        """Chip select and first address of ``place``."""
        return 0, place * IMAGE_BYTES

    def fetch(self) -> Routine[bool]:
        """Nothing is copied."""
        yield from ()
        return False

    def search(self, config: DetectionConfig) -> Routine[Detection]:
        """Find stars; a picture whose supply was cut meanwhile is lost, as pixels may stay zero."""
        search, answer = search_stars(ROWS, COLUMNS, config, self._meter), None
        while True:
            try:
                access = search.send(answer)
            except StopIteration as done:
                if self._supply.cut:
                    self._state.retained.image_present = 0
                detection: Detection = done.value
                return detection
            if isinstance(access, Look):
                answer = yield from self._reads(access.offsets, access.above)
            else:
                yield from self._writes(access.offsets, access.values)

    def read(self, start: int, count: int) -> Routine[bytes]:
        """Read bytes."""
        values = yield from self._reads(np.arange(start, start + count, dtype=np.int32))
        return values.tobytes()

    def read_now(self, start: int, count: int) -> bytes | None:
        """Read bytes in an interrupt; None while there is no way to the picture."""
        if not self._open or not self._supply.imager_on:
            return None
        select, first = self._address_of(self._state.retained.image_place)
        self._meter.charge(ebi_read=count)
        return self._hardware.bus_read(select, first + start, count)

    def write(self, start: int, data: NDArray[np.uint8]) -> Routine[None]:
        """Write bytes."""
        yield from self._writes(np.arange(start, start + len(data), dtype=np.int32), data)

    def test_memory(self) -> Routine[bool]:
        """Test all memories, one after the other."""
        passed = True
        for select, first, size in self.memories:
            addresses = np.arange(first, first + size, dtype=np.int32)
            pattern = test_pattern(size)
            for wanted in (pattern, ~pattern):
                yield from self._access(select, addresses, wanted, write=True)
                self._meter.charge(loop=size)
                found = np.zeros(size, np.uint8)
                yield from self._access(select, addresses, found, write=False)
                self._meter.charge(loop=size)
                passed &= bool(np.array_equal(found, wanted))
        return passed

    def _reads(self, offsets: NDArray[np.int32], above: int = 255) -> Routine[NDArray[np.uint8]]:
        select, first = self._address_of(self._state.retained.image_place)
        data = np.zeros(len(offsets), np.uint8)
        count = yield from self._access(select, offsets + first, data, write=False, above=above)
        return data[:count]

    def _writes(self, offsets: NDArray[np.int32], data: NDArray[np.uint8]) -> Routine[None]:
        select, first = self._address_of(self._state.retained.image_place)
        yield from self._access(select, offsets + first, data, write=True)

    def _access(
        self,
        select: int,
        addresses: NDArray[np.int32],
        data: NDArray[np.uint8],
        *,
        write: bool,
        above: int = 255,
    ) -> Routine[int]:
        """Make transactions; how many. They take their time, so they are booked, not charged."""
        operation = "ebi_write" if write else "ebi_read"
        cycles = self._meter.table.operations[operation].cycles
        count: int = yield BusAccess(
            np.ascontiguousarray(addresses, np.int32),
            np.ascontiguousarray(data),
            write,
            cycles,
            select,
            above,
        )
        self._meter.book(**{operation: count})
        return count

    def _bank(self) -> int:
        return int(self._state.settings.get("SelectImageBank", "Bank"))


class SharedPictures(_BusPictures):
    """One memory of two banks: either the FPGA stores, or the program has it.

    A place is a bank.
    """

    while_storing = False
    iteration_us = ITERATION_US

    def start(self) -> Routine[None]:
        """Take the bus."""
        yield SetPin(ENABLE, 0)
        yield SetPin(RNW, 1)
        yield SetPin(ENABLE, 1)
        self._open = True

    def begin(self) -> Routine[None]:
        """Give the bus away and store into the selected bank."""
        self._open = False
        self._state.retained.image_place = self._bank()
        yield SetPin(ENABLE, 0)
        yield SetPin(BANK, self._state.retained.image_place)
        yield SetPin(RNW, 0)
        yield SetPin(ENABLE, 1)

    def end(self, stored: bool) -> Routine[None]:
        """Take the bus back."""
        yield from self.start()


class TwoMemoryPictures(_BusPictures):
    """Two memories of one picture each at one FPGA, in turn.

    A place is a memory. There are no banks to select.
    """

    def start(self) -> Routine[None]:
        """Take the bus."""
        yield SetPin(RNW, 1)
        yield SetPin(ENABLE, 1)
        self._open = True

    def begin(self) -> Routine[None]:
        """Store into the other memory; the bus keeps the one of the newest picture."""
        yield SetPin(INTO, 1 - self._state.retained.image_place)
        yield SetPin(RNW, 0)

    def end(self, stored: bool) -> Routine[None]:
        """Have the bus for both."""
        yield SetPin(RNW, 1)
        if stored:
            self._state.retained.image_place ^= 1


class TwoBoardPictures(_BusPictures):
    """Two boards with one memory of two banks each, in turn.

    The lower bit of a place is its board, the upper one its bank.
    """

    memories = ((0, 0, 2 * IMAGE_BYTES), (1, 0, 2 * IMAGE_BYTES))

    def __init__(
        self, hardware: CubeStarHardware, state: State, meter: Meter, supply: SupplyMonitor
    ) -> None:
        """Store into the board that has not got the newest picture."""
        super().__init__(hardware, state, meter, supply)
        self._into = 0
        self._choose()

    def start(self) -> Routine[None]:
        """Take the bus at both boards."""
        for board in (0, 1):
            yield from self._take(board)
        self._open = True

    def begin(self) -> Routine[None]:
        """Store at the other board; the bus keeps the one of the newest picture."""
        self._choose()
        board = self._into & 1
        yield SetPin(_pin(board, ENABLE), 0)
        yield SetPin(_pin(board, BANK), self._into >> 1)
        yield SetPin(_pin(board, RNW), 0)
        yield SetPin(_pin(board, ENABLE), 1)

    def end(self, stored: bool) -> Routine[None]:
        """Have the bus for both."""
        yield from self._take(self._into & 1)
        if stored:
            self._state.retained.image_place = self._into

    def _choose(self) -> None:
        board = 1 - (self._state.retained.image_place & 1)
        self._into = board | self._bank() << 1
        self.acknowledge = _pin(board, ACK)

    def _take(self, board: int) -> Routine[None]:
        yield SetPin(_pin(board, ENABLE), 0)
        yield SetPin(_pin(board, RNW), 1)
        yield SetPin(_pin(board, ENABLE), 1)

    def _address_of(self, place: int) -> tuple[int, int]:
        return place & 1, (place >> 1) * IMAGE_BYTES


def _pin(board: int, name: str) -> str:
    return BOARD_PREFIXES[board] + name


_KINDS: dict[Layout, type[Pictures]] = {
    Layout.COPIED: CopiedPictures,
    Layout.SHARED: SharedPictures,
    Layout.TWO_MEMORIES: TwoMemoryPictures,
    Layout.TWO_BOARDS: TwoBoardPictures,
}


def pictures_of(
    layout: Layout, hardware: CubeStarHardware, state: State, meter: Meter, supply: SupplyMonitor
) -> Pictures:
    """The program's way to its pictures in ``layout``."""
    return _KINDS[layout](hardware, state, meter, supply)

"""Image memories and the program's access to them, by memory layout (CubeStar thesis, section 3.3).

The published layout is option 1: the FPGA stores into its own SRAM, and the program copies the
image to the processor's. In options 2 and 3, and with two boards (section 7.2), nothing is copied:
the program accesses the memories behind the FPGA over its external bus. Pins and addresses of these
are those of ``docs/gateware-cubestar-next.md``; they are assumed, as none of it was built. Visited
pixels are zeroed and written back over the bus.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar import detection
from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.cubestar.supply import SupplyMonitor
from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, ROWS
from cubestack.firmware_model.interface.cubestar import IMAGE_BYTES, pins
from cubestack.firmware_model.interface.cubestar.pins import Layout
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import BusAccess, Pay, Routine, SetPin, StrobeRead

ITERATION_US = 1_000_000
FAST_ITERATION_US = 500_000

_ENABLED, _DISABLED = (pins.ENABLE, 1), (pins.ENABLE, 0)
_READING, _STORING = (pins.RNW, 1), (pins.RNW, 0)
_TAKE = (_DISABLED, _READING, _ENABLED)  #: levels that connect the bus to the memory


def _drive(*levels: tuple[str, int], board: str = "") -> Routine[None]:
    for pin, level in levels:
        yield SetPin(board + pin, level)


@dataclass(eq=False)
class ImageMemory(ABC):
    """The newest image, and the storage of the next one.

    All offsets are within the newest image, of ``IMAGE_BYTES``. A place is a position for an image;
    ``Retained.image_place`` is that of the newest one.
    """

    state: State
    meter: Meter
    supply: SupplyMonitor

    acknowledge = str(pins.ACK)  #: pin that signals a stored image
    while_storing = True  #: the newest image can be processed while the next one is stored
    iteration_us = FAST_ITERATION_US  #: period of the loop
    selects: ClassVar[tuple[int, ...]] = (0,)  #: chip select of each memory of two images

    @abstractmethod
    def start(self) -> Routine[None]: ...

    @abstractmethod
    def begin(self) -> Routine[None]:
        """Let the FPGA store the next whole frame."""

    @abstractmethod
    def end(self, stored: bool) -> Routine[None]:
        """Stop storing; a frame that is ``stored`` becomes the newest image."""

    @abstractmethod
    def fetch(self) -> Routine[bool]:
        """Copy the stored frame to the processor's memory; False if the layout copies nothing."""

    @abstractmethod
    def search(self, config: detection.DetectionConfig) -> Routine[detection.Detection]:
        """Find stars; see ``detect_stars``."""

    @abstractmethod
    def read_now(self, start: int, count: int) -> bytes | None:
        """Read bytes in an interrupt; None if they are not accessible."""

    def read(self, start: int, count: int) -> Routine[bytes]:
        values = yield from self._reads(np.arange(start, start + count, dtype=np.int32))
        return values.tobytes()

    def sample(self, offsets: NDArray[np.int32]) -> Routine[NDArray[np.uint8]]:
        """Single pixels, one after the other."""
        return (yield from self._reads(offsets))

    def write(self, start: int, data: NDArray[np.uint8]) -> Routine[None]:
        yield from self._writes(np.arange(start, start + len(data), dtype=np.int32), data)

    def test_memory(self) -> Routine[bool]:
        """Write a pattern and read it back, then its complement; the image is lost."""
        addresses = np.arange(2 * IMAGE_BYTES, dtype=np.int32)
        pattern = (addresses * 167 >> 3).astype(np.uint8)  # differs between rows
        passed = True
        for select in self.selects:
            for wanted in (pattern, ~pattern):
                found = np.zeros_like(wanted)
                for data, write in ((wanted, True), (found, False)):
                    yield from self._access(select, addresses, data, write=write)
                    self.meter.charge(loop=len(addresses))
                passed &= bool(np.array_equal(found, wanted))
        return passed

    def _reads(self, offsets: NDArray[np.int32], above: int = 255) -> Routine[NDArray[np.uint8]]:
        select, first = self._address_of(self.state.retained.image_place)
        data = np.zeros(len(offsets), np.uint8)
        count = yield from self._access(select, offsets + first, data, write=False, above=above)
        return data[:count]

    def _writes(self, offsets: NDArray[np.int32], data: NDArray[np.uint8]) -> Routine[None]:
        select, first = self._address_of(self.state.retained.image_place)
        yield from self._access(select, offsets + first, data, write=True)

    def _address_of(self, place: int) -> tuple[int, int]:
        return 0, place * IMAGE_BYTES

    def _access(
        self,
        select: int,
        addresses: NDArray[np.int32],
        data: NDArray[np.uint8],
        *,
        write: bool,
        above: int = 255,
    ) -> Routine[int]:
        operation = "ebi_write" if write else "ebi_read"
        access = BusAccess(
            np.ascontiguousarray(addresses, np.int32),
            np.ascontiguousarray(data),
            write,
            self.meter.table.operations[operation].cycles,
            select,
            above,
        )
        return (yield from self._perform(access, operation))

    @abstractmethod
    def _perform(self, access: BusAccess, operation: str) -> Routine[int]:
        """Perform ``access`` and charge ``operation`` for each transaction."""

    def _bank(self) -> int:
        return int(self.state.settings.get("SelectImageBank", "Bank"))


class _CopiedImages(ImageMemory):
    """Images at the start of the processor's own external RAM."""

    iteration_us = ITERATION_US

    @property
    def image(self) -> NDArray[np.uint8]:
        """The newest image, shape (512, 1024), a live view of the external RAM."""
        return self.state.hardware.external_ram[:IMAGE_BYTES].reshape(ROWS, COLUMNS)

    def start(self) -> Routine[None]:
        yield from ()  # pins are as a reset leaves them

    def begin(self) -> Routine[None]:
        yield from _drive((pins.BANK, self._bank()), _STORING, _ENABLED)

    def end(self, stored: bool) -> Routine[None]:
        yield from _drive(_DISABLED)

    def fetch(self) -> Routine[bool]:
        yield from _drive(_READING, _ENABLED)
        self.supply.sample()
        cycles = self.meter.table.operations["transfer_byte"].cycles
        yield StrobeRead(self.state.hardware.external_ram[:IMAGE_BYTES], cycles)
        yield from _drive(_DISABLED, _STORING)
        return True

    def search(self, config: detection.DetectionConfig) -> Routine[detection.Detection]:
        yield from ()
        return detection.detect_stars(self.image, config, self.meter)

    def read_now(self, start: int, count: int) -> bytes:
        self.meter.charge(ebi_read=count)
        return self.state.hardware.external_ram[start : start + count].tobytes()

    def _perform(self, access: BusAccess, operation: str) -> Routine[int]:
        memory, data = self.state.hardware.external_ram, access.data
        if access.write:
            memory[access.addresses] = data
        else:
            data[:] = memory[access.addresses]
        self.meter.charge(**{operation: len(data)})
        yield Pay()
        return len(data)


class _BusMemory(ImageMemory):
    """Base of the layouts without a copy."""

    _open = False  #: the bus leads to the newest image

    def fetch(self) -> Routine[bool]:
        yield from ()
        return False

    def search(self, config: detection.DetectionConfig) -> Routine[detection.Detection]:
        """Find stars; if the supply is cut meanwhile, the image is lost: pixels may stay zero."""
        search, answer = detection.search_stars(ROWS, COLUMNS, config, self.meter), None
        while True:
            try:
                access = search.send(answer)
            except StopIteration as done:
                if self.supply.cut:
                    self.state.retained.image_present = 0
                found: detection.Detection = done.value
                return found
            if isinstance(access, detection.Look):
                answer = yield from self._reads(access.offsets, access.above)
            else:
                yield from self._writes(access.offsets, access.values)

    def read_now(self, start: int, count: int) -> bytes | None:
        if not self._open or not self.supply.imager_on:
            return None
        select, first = self._address_of(self.state.retained.image_place)
        self.meter.charge(ebi_read=count)
        return self.state.hardware.bus_read(select, first + start, count)

    def _perform(self, access: BusAccess, operation: str) -> Routine[int]:
        count: int = yield access
        self.meter.charge_elapsed(**{operation: count})
        return count


class _SharedMemory(_BusMemory):
    """One memory of two banks, the places: either the FPGA or the program accesses it."""

    while_storing = False
    iteration_us = ITERATION_US

    def start(self) -> Routine[None]:
        yield from _drive(*_TAKE)
        self._open = True

    def begin(self) -> Routine[None]:
        self._open = False
        self.state.retained.image_place = bank = self._bank()
        yield from _drive(_DISABLED, (pins.BANK, bank), _STORING, _ENABLED)

    def end(self, stored: bool) -> Routine[None]:
        yield from self.start()


class _TwoMemories(_BusMemory):
    """Two memories of one image each, the places, at one FPGA, used alternately."""

    def start(self) -> Routine[None]:
        yield from _drive(_READING, _ENABLED)
        self._open = True

    def begin(self) -> Routine[None]:
        """Store into the other memory; the bus stays connected to the newest image."""
        yield from _drive((pins.INTO, 1 - self.state.retained.image_place), _STORING)

    def end(self, stored: bool) -> Routine[None]:
        yield from _drive(_READING)
        if stored:
            self.state.retained.image_place ^= 1


class _TwoBoards(_BusMemory):
    """Two boards with one memory of two banks each, used alternately.

    The low bit of a place is its board, the high bit its bank.
    """

    selects = (0, 1)

    def __post_init__(self) -> None:
        self._choose()

    def start(self) -> Routine[None]:
        for board in pins.BOARD_PREFIXES:
            yield from _drive(*_TAKE, board=board)
        self._open = True

    def begin(self) -> Routine[None]:
        """Store on the other board; the bus stays connected to the newest image."""
        self._choose()
        bank = (pins.BANK, self._into >> 1)
        yield from _drive(_DISABLED, bank, _STORING, _ENABLED, board=self._board)

    def end(self, stored: bool) -> Routine[None]:
        yield from _drive(*_TAKE, board=self._board)
        if stored:
            self.state.retained.image_place = self._into

    def _choose(self) -> None:
        """Select the board that does not hold the newest image."""
        self._into = ~self.state.retained.image_place & 1 | self._bank() << 1
        self._board = pins.BOARD_PREFIXES[self._into & 1]
        self.acknowledge = self._board + pins.ACK

    def _address_of(self, place: int) -> tuple[int, int]:
        return place & 1, (place >> 1) * IMAGE_BYTES


_KINDS: dict[Layout, type[ImageMemory]] = {
    Layout.COPIED: _CopiedImages,
    Layout.SHARED: _SharedMemory,
    Layout.TWO_MEMORIES: _TwoMemories,
    Layout.TWO_BOARDS: _TwoBoards,
}


def image_memory(layout: Layout, state: State, meter: Meter, supply: SupplyMonitor) -> ImageMemory:
    return _KINDS[layout](state, meter, supply)

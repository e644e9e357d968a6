"""Pictures behind the FPGA: what the program does over its bus, on memories that are arrays."""

import struct

import numpy as np
import pytest
from numpy.typing import NDArray

from cubestack.firmware_model.cubestar.catalogue import StarCatalogue
from cubestack.firmware_model.cubestar.detection import DetectionConfig, detect_stars
from cubestack.firmware_model.cubestar.image_memory import ITERATION_US, image_memory
from cubestack.firmware_model.cubestar.memory import CAPACITY, RETENTION_BYTES, budget
from cubestack.firmware_model.cubestar.state import State
from cubestack.firmware_model.cubestar.supply import SupplyMonitor
from cubestack.firmware_model.interface.cubestar import IMAGE_BYTES
from cubestack.firmware_model.interface.cubestar.pins import Layout
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.external_bus import EBI
from cubestack.firmware_model.mcu.memory import Buffer, FlashStore, Memory, used
from cubestack.firmware_model.mcu.requests import BusAccess, Request

from ..runner import Runner
from .sky import Sky

ON_BUS = [layout for layout in Layout if layout is not Layout.COPIED]
SIZE = 2 * IMAGE_BYTES


class Board(Runner):
    """Memories by chip select, as arrays, and the pins; it says which accesses find an answer."""

    def __init__(self, layout: Layout) -> None:
        super().__init__(CORTEX_M3)
        self.layout = layout
        self.retention = bytearray(RETENTION_BYTES)
        self.flash = FlashStore()
        self.external_ram = np.zeros(0, np.uint8)
        self.memories = {select: np.zeros(SIZE, np.uint8) for select in (0, 1)}
        self.pins: dict[str, int] = {}
        self.levels: list[tuple[str, int]] = []
        self.state = State(self, self.meter)  # type: ignore[arg-type]  # what it does not use is missing
        self.image_memory = image_memory(layout, self.state, self.meter, SupplyMonitor(self.state))
        self.accesses = 0
        self.stuck: list[int] = []
        self.perform(self.image_memory.start())

    def _pay(self) -> None:
        """Cycles stay on the meter, for tests to look at."""

    def set_pin(self, pin: str, level: int) -> None:
        self.pins[pin] = level
        self.levels.append((pin, level))

    def bus_read(self, select: int, address: int, count: int) -> bytes:
        assert self._open(select, address)
        return self.memories[select][address : address + count].tobytes()

    def access(self, request: BusAccess) -> int:
        assert request.cycles == 2 + EBI.cycles
        assert self._open(request.select, int(request.addresses[0]))
        memory = self.memories[request.select]
        if request.write:
            memory[request.addresses] = request.data
            memory[self.stuck] |= 1
            count = len(request.addresses)
        else:
            values = memory[request.addresses]
            above = np.flatnonzero(values > request.above)
            count = int(above[0]) + 1 if len(above) else len(values)
            request.data[:count] = values[:count]
        self.accesses += count
        return count

    def _open(self, select: int, address: int) -> bool:
        if self.layout is Layout.TWO_BOARDS:
            board = f"BOARD{select + 1}_"
            return bool(self.pins[f"{board}ENABLE"] and self.pins[f"{board}RNW"])
        reached = self.pins["RNW"]
        if self.layout is Layout.TWO_MEMORIES and not reached:
            reached = self.pins["INTO"] != address // IMAGE_BYTES
        return bool(self.pins["ENABLE"] and reached)

    def stored(self, picture: NDArray[np.uint8]) -> None:
        self.perform(self.image_memory.begin())
        select, place = 0, self.pins.get("BANK", 0)
        if self.layout is Layout.TWO_MEMORIES:
            place = self.pins["INTO"]
        if self.layout is Layout.TWO_BOARDS:
            (select,) = (n for n in (0, 1) if not self.pins[f"BOARD{n + 1}_RNW"])
            assert self.image_memory.acknowledge == f"BOARD{select + 1}_ACK"
            place = self.pins[f"BOARD{select + 1}_BANK"]
        self.memories[select][place * IMAGE_BYTES :][:IMAGE_BYTES] = picture.reshape(-1)
        self.perform(self.image_memory.end(True))


@pytest.fixture(params=ON_BUS, ids=lambda layout: layout.value)
def board(request: pytest.FixtureRequest) -> Board:
    return Board(request.param)


def read_all(board: Board) -> NDArray[np.uint8]:
    return np.frombuffer(board.perform(board.image_memory.read(0, IMAGE_BYTES)), np.uint8)


def test_newest_image_is_read_from_its_bank(board: Board) -> None:
    rng = np.random.default_rng(5)
    for bank in (0, 0, 1, 1, 0):
        board.state.settings.put("SelectImageBank", {"Bank": bank})
        picture = rng.integers(0, 256, IMAGE_BYTES, dtype=np.uint8)
        board.stored(picture)
        assert np.array_equal(read_all(board), picture)
        assert board.image_memory.read_now(1234, 128) == picture[1234:][:128].tobytes()


def test_aborted_store_leaves_the_last_image_in_a_second_memory(board: Board) -> None:
    """Where there is a second memory; a shared one holds half of a picture then."""
    picture = np.arange(IMAGE_BYTES).astype(np.uint8)
    board.stored(picture)
    board.perform(board.image_memory.begin())
    board.perform(board.image_memory.end(False))
    assert np.array_equal(read_all(board), picture)


def test_last_image_is_readable_during_a_store_unless_memory_is_shared(board: Board) -> None:
    picture = np.arange(IMAGE_BYTES).astype(np.uint8)
    board.stored(picture)
    board.perform(board.image_memory.begin())
    if board.image_memory.while_storing:
        assert np.array_equal(read_all(board), picture)
        assert board.image_memory.read_now(7, 9) == picture[7:16].tobytes()
    else:
        assert board.layout is Layout.SHARED
        assert board.image_memory.read_now(7, 9) is None


def test_unpowered_image_memory_cannot_be_read(board: Board) -> None:
    board.state.retained.imager_off = 1
    assert board.image_memory.read_now(0, 1) is None


@pytest.mark.parametrize("config", [DetectionConfig(), DetectionConfig(background=True)])
def test_search_equals_array_search(board: Board, sky: Sky, config: DetectionConfig) -> None:
    """The same stars for the same charge; the accesses are booked, as their time has passed."""
    board.stored(sky.picture)
    own = Meter(CORTEX_M3)
    expected = detect_stars(sky.picture, config, own)
    board.meter.take()
    before, accesses = dict(board.meter.counts), board.accesses
    found = board.perform(board.image_memory.search(config))
    assert np.array_equal(found.centroids, expected.centroids)
    assert np.array_equal(found.intensities, expected.intensities)
    assert (found.dark_value, found.end) == (expected.dark_value, expected.end)
    spent = {k: v - before.get(k, 0) for k, v in board.meter.counts.items()}
    assert {k: v for k, v in spent.items() if v} == {k: v for k, v in own.counts.items() if v}
    assert board.accesses - accesses == own.counts["ebi_read"] + own.counts["ebi_write"]
    assert board.meter.phases == own.phases
    on_the_bus = (2 + EBI.cycles) * (own.counts["ebi_read"] + own.counts["ebi_write"])
    assert board.meter.take() == own.take() - on_the_bus
    assert np.array_equal(read_all(board), sky.picture.reshape(-1))


def test_visited_pixels_are_zeroed_over_the_bus(board: Board, sky: Sky) -> None:
    board.stored(sky.picture)
    written: set[int] = set()

    def look(request: Request) -> None:
        if isinstance(request, BusAccess) and request.write and len(request.data) == 1:
            written.add(int(request.data[0]))

    board.on_request = look
    board.perform(board.image_memory.search(DetectionConfig()))
    assert written == {0}


def test_memory_test_finds_one_bit_in_any_memory(board: Board) -> None:
    assert board.perform(board.image_memory.test_memory()) is True
    boards = 2 if board.layout is Layout.TWO_BOARDS else 1
    assert board.accesses == 4 * boards * SIZE  # every place, both ways, twice
    for stuck in (0, 777_777, SIZE - 1):
        board.stuck = [stuck]
        assert board.perform(board.image_memory.test_memory()) is False


@pytest.mark.parametrize(
    ("layout", "log"),
    [
        (Layout.SHARED, "ENABLE0 BANK0 RNW0 ENABLE1 ENABLE0 RNW1 ENABLE1"),
        (Layout.TWO_MEMORIES, "INTO1 RNW0 RNW1"),
        (
            Layout.TWO_BOARDS,
            "BOARD2_ENABLE0 BOARD2_BANK0 BOARD2_RNW0 BOARD2_ENABLE1 "
            "BOARD2_ENABLE0 BOARD2_RNW1 BOARD2_ENABLE1",
        ),
    ],
)
def test_control_pins_change_in_the_gateware_s_order(layout: Layout, log: str) -> None:
    """RNW never changes under ENABLE where that would hand over the address in a write pulse."""
    board = Board(layout)
    board.levels.clear()
    board.stored(np.zeros(IMAGE_BYTES, np.uint8))
    assert " ".join(f"{pin}{level}" for pin, level in board.levels) == log


def test_rate_is_twice_as_high_with_two_memories() -> None:
    rates = {layout: ITERATION_US / Board(layout).image_memory.iteration_us for layout in ON_BUS}
    assert rates == {Layout.SHARED: 1, Layout.TWO_MEMORIES: 2, Layout.TWO_BOARDS: 2}


@pytest.mark.parametrize("layout", Layout)
@pytest.mark.parametrize("count", [1, 97, 128])
def test_interrupt_is_charged_for_each_byte_it_reads(layout: Layout, count: int) -> None:
    """The memory has eight data lines: a bus cycle a byte."""
    board = Board(layout)
    board.external_ram = np.zeros(IMAGE_BYTES, np.uint8)
    board.stored(np.zeros(IMAGE_BYTES, np.uint8))
    accesses, cycles = board.meter.counts["ebi_read"], board.meter.total
    assert len(board.image_memory.read_now(5, count) or b"") == count
    assert board.meter.counts["ebi_read"] - accesses == count
    assert board.meter.total - cycles >= count * EBI.cycles


PROGRAM_RAM = 32 * 1024
"""Left for what the model does not have: library data, other peripherals' buffers."""


@pytest.fixture(scope="module")
def buffers(catalogue: StarCatalogue) -> tuple[Buffer, ...]:
    return budget(catalogue)


def size(buffers: tuple[Buffer, ...], name: str) -> int:
    """Size of the buffer ``name`` in bytes; it must be the only one."""
    (found,) = [buffer.size for buffer in buffers if buffer.name == name]
    return found


@pytest.mark.parametrize("memory", Memory)
def test_memory_budget_fits_the_cubestar_memories(
    buffers: tuple[Buffer, ...], memory: Memory
) -> None:
    spare = PROGRAM_RAM if memory is Memory.RAM else 0
    assert 0 < used(buffers)[memory] <= CAPACITY[memory] - spare


def test_memory_capacities_match_the_part() -> None:
    kilobytes = {memory.name: size / 1024 for memory, size in CAPACITY.items()}
    assert kilobytes == {"RAM": 128, "FLASH": 1024, "EXTERNAL_RAM": 1024, "RETENTION": 0.5}


def test_memory_use_counts_every_byte_once(buffers: tuple[Buffer, ...]) -> None:
    assert sum(used(buffers).values()) == sum(buffer.size for buffer in buffers)
    assert all(buffer.size > 0 for buffer in buffers)
    assert len({(buffer.name, buffer.memory) for buffer in buffers}) == len(buffers)


def test_memory_budget_contains_the_catalogue_size(
    buffers: tuple[Buffer, ...], catalogue: StarCatalogue
) -> None:
    listed = size(buffers, "star list") + size(buffers, "pair list")
    assert listed == len(catalogue.to_bytes())


def test_memory_budget_sizes_match_other_sources(buffers: tuple[Buffer, ...]) -> None:
    assert size(buffers, "image") == IMAGE_BYTES
    retained = [buffer.size for buffer in buffers if buffer.memory is Memory.RETENTION]
    assert sum(retained) == State.RETENTION_SIZE
    assert size(buffers, "stars of the image before") == struct.calcsize("<2I B 18H")
    # Section 4.3: 190 pairs of 20 stars; votes of each star for each of 405.
    assert size(buffers, "pairs of stars") == 190 * 8
    assert size(buffers, "votes") == 2 * 20 * 405


def test_visited_pixels_fit_at_the_limits_of_all_settings(buffers: tuple[Buffer, ...]) -> None:
    # 20 stars and 51 invalid areas of 100 pixels, 256 noise areas of 99, four bytes each
    assert size(buffers, "visited pixels") == 4 * (71 * 100 + 256 * 99)


def test_memory_budget_counts_all_data_of_stars_beyond_20(buffers: tuple[Buffer, ...]) -> None:
    # 20 more: centroid, undistorted point, vector; size, intensity. The expected error of all 40.
    more = 20 * struct.calcsize("<2f 2f 3f B H") + 40 * struct.calcsize("<f")
    assert size(buffers, "stars beyond the published list") == more


def test_reduced_pair_lists_fit_the_memory_budget(
    buffers: tuple[Buffer, ...], catalogue: StarCatalogue
) -> None:
    rng = np.random.default_rng(3)
    directions = rng.normal(size=(200, 3)).astype(np.float32)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    meter = Meter(CORTEX_M3)
    sizes = [8 * len(catalogue.reduced(each, 35.0, meter)[1]) for each in directions]
    assert max(sizes) <= 1.05 * size(buffers, "reduced pair list")

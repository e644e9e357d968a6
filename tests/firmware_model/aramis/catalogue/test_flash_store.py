import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.emulator.boards.aramis.catalogue import CatalogueParameters
from cubestack.firmware_model.aramis.catalogue import hamming
from cubestack.firmware_model.aramis.catalogue.flash_store import CatalogueStore, flash_image
from cubestack.firmware_model.aramis.catalogue.hamming import decode, encode
from cubestack.firmware_model.aramis.catalogue.ram_copy import Protection
from cubestack.firmware_model.aramis.hardware import CATALOGUE_AT, SECTOR_BYTES
from cubestack.firmware_model.interface.aramis import MOST_CATALOGUE_BYTES, CatalogueState
from cubestack.host.studies.aramis.sky import database, meter

from ..harness import Harness


class Desk:
    def __init__(self, image: bytes | None = None, protection: Protection = "checksum") -> None:
        self.unit = Harness()
        real = database(CatalogueParameters(step_deg=10, stars_per_field=5)).pack()
        self.image = real if image is None else image
        self.coded = flash_image(self.image)
        self.unit.catalogue_flash[: len(self.coded)] = self.coded
        self.store = CatalogueStore(self.unit, self.unit.meter, protection)

    def load(self) -> bool:
        return self.unit.perform(self.store.load())

    def flip_flash(self, *bits: int) -> None:
        for bit in bits:
            self.unit.catalogue_flash[bit // 8] ^= np.uint8(1 << bit % 8)

    @property
    def ram(self) -> np.ndarray:
        return self.unit.sdram[CATALOGUE_AT : CATALOGUE_AT + len(self.image)]


@pytest.fixture
def desk() -> Desk:
    return Desk()


def test_catalogue_is_loaded_as_written(desk: Desk) -> None:
    store = desk.store
    assert desk.load()
    assert store.state is CatalogueState.GOOD
    assert desk.ram.tobytes() == store.database.pack() == desk.image
    assert (store.corrected, store.lost, store.loads, store.failures) == (0, 0, 1, 0)
    assert store.length == len(desk.image)


def test_catalogue_load_takes_less_than_2_5_times_the_flash_read_time(desk: Desk) -> None:
    desk.load()
    flash_us = len(desk.coded) / 2 * 0.070
    assert flash_us < desk.store.load_us < 2.5 * flash_us
    assert desk.store.loaded_us == desk.unit.now_us


def test_single_errors_all_over_the_flash_are_corrected(desk: Desk) -> None:
    words = len(desk.coded) // 9
    rng = np.random.default_rng(3)
    damaged = np.unique(np.concatenate([[0, 1, words - 1], rng.integers(0, words, 500)]))
    desk.flip_flash(*(int(word) * 72 + int(rng.integers(72)) for word in damaged))
    assert desk.load()
    assert desk.store.corrected == len(damaged) == desk.store.corrected_total
    assert desk.ram.tobytes() == desk.image
    desk.load()
    assert desk.store.corrected_total == 2 * len(damaged)


@pytest.mark.parametrize("word", [0, 1, 5000, -1])
def test_two_flipped_bits_in_a_word_fail_the_catalogue_load(desk: Desk, word: int) -> None:
    word %= len(desk.coded) // 9
    desk.flip_flash(72 * word + 3, 72 * word + 40)
    assert not desk.load()
    assert (desk.store.state, desk.store.database) == (CatalogueState.DAMAGED, None)
    assert (desk.store.length, desk.store.lost, desk.store.failures) == (0, 1, 1)


def test_checksum_detects_three_errors_miscorrected_as_one(desk: Desk) -> None:
    rng = np.random.default_rng(5)
    for _ in range(200):  # until a triple is taken for a single error
        bits = 72 * 700 + rng.choice(72, 3, replace=False)
        desk.flip_flash(*bits.tolist())
        desk.load()
        desk.flip_flash(*bits.tolist())
        assert desk.store.state is CatalogueState.DAMAGED
        if not desk.store.lost:
            break
    else:
        pytest.fail("no triple error was miscorrected")


def test_erased_flash_holds_no_catalogue(desk: Desk) -> None:
    for content in (0xFF, 0):
        desk.unit.catalogue_flash[:] = content
        assert not desk.load()
        assert desk.store.state is CatalogueState.MISSING


@pytest.mark.parametrize("content", [b"", b"x", b"ARAM" + bytes(100)])
def test_rejects_contents_that_are_no_catalogue(content: bytes) -> None:
    desk = Desk(content)
    assert not desk.load()
    assert desk.store.state in (CatalogueState.DAMAGED, CatalogueState.MISSING)
    assert (desk.store.loads, desk.store.failures) == (1, 1)


def test_rejects_catalogue_larger_than_flash() -> None:
    with pytest.raises(ValueError, match="fewer stars per field"):
        flash_image(bytes(MOST_CATALOGUE_BYTES + 1))


def test_damaged_catalogue_in_ram_is_detected_and_reloaded(desk: Desk) -> None:
    desk.load()
    assert desk.unit.perform(desk.store.ensure())
    assert desk.store.loads == 1
    for place in (0, 100, len(desk.image) // 2, len(desk.image) - 1):
        errors = desk.store.ram_errors
        desk.ram[place] ^= 0x10
        assert desk.unit.perform(desk.store.ensure())
        assert desk.store.ram_errors == errors + 1
        assert desk.ram.tobytes() == desk.image


@pytest.mark.parametrize("protection", ["redundant", "coded"])
def test_protected_copy_is_mended_without_the_flash(protection: Protection) -> None:
    desk = Desk(protection=protection)
    desk.load()
    desk.unit.catalogue_flash[:] = 0xFF
    desk.ram[[5, 5000]] ^= 0x10
    assert desk.unit.perform(desk.store.ensure())
    assert desk.ram.tobytes() == desk.image
    assert (desk.store.loads, desk.store.ram_errors, desk.store.corrected_total) == (1, 1, 2)


def test_two_errors_in_a_coded_word_load_the_catalogue_again() -> None:
    desk = Desk(protection="coded")
    desk.load()
    desk.ram[[5, 5000, 5001]] ^= 0x10
    assert desk.unit.perform(desk.store.ensure())
    assert desk.ram.tobytes() == desk.image
    assert (desk.store.loads, desk.store.ram_errors) == (2, 1)
    assert desk.unit.perform(desk.store.ensure())
    assert desk.store.ram_errors == 1


@pytest.mark.parametrize("protection", ["redundant", "coded"])
def test_periodic_reload_keeps_the_protection_whole(protection: Protection) -> None:
    desk = Desk(protection=protection)
    desk.load()
    desk.load()
    desk.ram[77] ^= 1
    assert desk.unit.perform(desk.store.ensure())
    assert (desk.store.loads, desk.store.corrected_total) == (2, 1)


def test_damage_in_ram_and_flash_leaves_no_catalogue(desk: Desk) -> None:
    desk.load()
    desk.ram[77] ^= 1
    desk.flip_flash(72 * 300, 72 * 300 + 1)
    assert not desk.unit.perform(desk.store.ensure())
    assert desk.store.state is CatalogueState.DAMAGED
    assert not desk.unit.perform(desk.store.ensure())


def test_failed_reload_keeps_the_good_copy(desk: Desk) -> None:
    desk.load()
    database = desk.store.database
    desk.flip_flash(72 * 300, 72 * 300 + 1)
    assert desk.load()
    assert desk.store.database is database
    assert (desk.store.lost, desk.store.failures) == (1, 1)
    assert desk.store.state is CatalogueState.GOOD
    assert desk.unit.perform(desk.store.ensure())
    assert desk.ram.tobytes() == desk.image


def test_catalogue_load_steps_take_less_than_5_ms(desk: Desk) -> None:
    ended, times_us = False, [desk.unit.now_us]
    while not ended:
        ended = desk.unit.perform(desk.store.load_step())
        assert desk.store.loading is not ended
        times_us.append(desk.unit.now_us)
    assert len(times_us) > 11
    assert np.diff(times_us[:-1]).max() < 5_000
    assert desk.store.database is not None


def test_refreshing_repairs_the_flash_from_ram(desk: Desk) -> None:
    assert not desk.unit.perform(desk.store.refresh())  # nothing in RAM yet
    desk.load()
    desk.flip_flash(72 * 300, 72 * 300 + 1, 72 * 500)
    before_us = desk.unit.now_us
    assert desk.unit.perform(desk.store.refresh())
    np.testing.assert_array_equal(desk.unit.catalogue_flash[: len(desk.coded)], desk.coded)
    sectors = -(-len(desk.coded) // SECTOR_BYTES)
    assert desk.unit.now_us - before_us > sectors * 800_000 + len(desk.coded) // 2 * 10


def test_random_upsets_at_one_in_a_million_never_leave_a_wrong_byte(desk: Desk) -> None:
    """The rate that the code is to stand: every load is the true image or is refused."""
    rng = np.random.default_rng(11)
    bits = 8 * len(desk.coded)
    good = 0
    for _ in range(20):
        flips = np.unique(rng.integers(0, bits, rng.poisson(bits * 1e-6))).tolist()
        desk.flip_flash(*flips)
        desk.store.forget()
        if desk.load():
            good += 1
            assert desk.ram.tobytes() == desk.image
            assert desk.store.corrected == len(flips)
        desk.flip_flash(*flips)
    assert good == 20


@pytest.mark.parametrize("size", [800, 80_000, 250_000])
def test_programming_takes_the_flash_s_times(size: int) -> None:
    """Of the data sheet: 0.8 s to erase 64 KiB, 10 us to write 16 bits; and the program's own."""
    unit = Harness()
    store = CatalogueStore(unit, unit.meter)
    unit.perform(store.program(bytes(size)))
    coded = len(flash_image(bytes(size)))
    assert coded == pytest.approx(size * 9 / 8, abs=50)  # eight bits of code for 64, and a header
    computing_us = unit.meter.total / unit.meter.table.clock_hz * 1e6
    flash_us = -(-coded // 65_536) * 800_000 + coded / 2 * 10
    assert unit.now_us == pytest.approx(flash_us + computing_us, abs=10)
    assert computing_us < coded / 2 * 10


words = st.binary(min_size=8, max_size=8)


def flipped(coded: np.ndarray, *bits: int) -> np.ndarray:
    damaged = coded.copy()
    for bit in bits:
        damaged[bit // 8] ^= 1 << bit % 8
    return damaged


def test_hamming_columns_are_distinct_with_odd_weight_above_1() -> None:
    columns = hamming._columns()
    assert len(set(columns)) == 64
    assert all(column.bit_count() % 2 == 1 and column.bit_count() > 1 for column in columns)


@given(st.binary(max_size=100))
def test_undamaged_words_are_unchanged(data: bytes) -> None:
    coded = encode(data)
    assert len(coded) == hamming.coded_size(len(data))
    decoded = decode(coded, meter())
    assert decoded.data.tobytes() == data + bytes(-len(data) % 8)
    assert (decoded.corrected, len(decoded.lost)) == (0, 0)


@given(words)
def test_each_single_error_is_corrected(data: bytes) -> None:
    coded = encode(data)
    copies = np.concatenate([flipped(coded, bit) for bit in range(72)])
    before = copies.copy()
    decoded = decode(copies, meter())
    np.testing.assert_array_equal(copies, before)
    assert decoded.data.tobytes() == data * 72
    assert (decoded.corrected, len(decoded.lost)) == (72, 0)


@given(words)
def test_each_double_error_is_detected(data: bytes) -> None:
    coded = encode(data)
    pairs = [(one, two) for one in range(72) for two in range(one)]
    copies = np.concatenate([flipped(coded, *pair) for pair in pairs])
    decoded = decode(copies, meter())
    assert decoded.corrected == 0
    assert decoded.lost.tolist() == list(range(len(pairs)))


def test_hamming_code_is_linear() -> None:
    """The check byte of a sum is the sum of the check bytes: an oracle for the tables."""
    rng = np.random.default_rng(1)
    one, two = rng.bytes(8), rng.bytes(8)
    both = bytes(a ^ b for a, b in zip(one, two, strict=True))
    assert (encode(one) ^ encode(two)).tolist() == encode(both).tolist()
    single = encode((1 << 5).to_bytes(8, "little"))
    assert single[8] == hamming._columns()[5]


def test_flash_decoding_cost_is_proportional_to_the_words_read() -> None:
    counter = meter()
    decode(encode(bytes(800)), counter)
    assert counter.counts["coded_word"] == 100
    assert counter.counts["flash_read"] == 100 * hamming.CODED_BYTES // 2


def test_rejects_partial_words() -> None:
    with pytest.raises(ValueError, match="words of 9 bytes, not 10"):
        decode(np.zeros(10, np.uint8), meter())

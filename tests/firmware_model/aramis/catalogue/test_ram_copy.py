"""The catalogue in RAM: damage is mended or found, whatever protects it."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cubestack.firmware_model.aramis.catalogue.hamming import decode, encode
from cubestack.firmware_model.aramis.catalogue.ram_copy import (
    CHECKS_AT,
    SECOND_AT,
    Protection,
    RamCopy,
)
from cubestack.firmware_model.aramis.hardware import CATALOGUE_AT, UPLOAD_AT
from cubestack.firmware_model.interface.aramis import MOST_CATALOGUE_BYTES
from cubestack.host.studies.aramis.sky import meter

LENGTH = 803  # the last word is not whole


class Desk:
    def __init__(self, protection: Protection, length: int = LENGTH) -> None:
        self.sdram = np.zeros(UPLOAD_AT, np.uint8)
        self.sdram[CATALOGUE_AT:][: length + 100] = 0xA5  # behind the catalogue too
        self.meter = meter()
        self.copy = RamCopy(self.sdram, self.meter, protection)
        self.image = np.random.default_rng(4).bytes(length)
        self.copy.write(0, decode(encode(self.image), meter()), length)
        self.copy.accept(length)
        self.before = self.sdram.copy()

    def flip(self, place: int, bit: int) -> None:
        self.sdram[place] ^= np.uint8(1 << bit)

    def flip_in_word(self, word: int, bit: int) -> None:
        """Bit 0 to 71 of a coded word."""
        place = CATALOGUE_AT + 8 * word + bit // 8 if bit < 64 else CHECKS_AT + word
        self.flip(place, bit % 8)

    @property
    def is_whole(self) -> bool:
        return np.array_equal(self.sdram, self.before)


@pytest.mark.parametrize("protection", ["checksum", "redundant", "coded"])
def test_undamaged_copy_has_no_wrong_words(protection: Protection) -> None:
    desk = Desk(protection)
    assert desk.copy.check() == 0
    assert desk.copy.view(LENGTH).tobytes() == desk.image
    assert desk.is_whole


def test_coded_copy_mends_every_single_error_in_place() -> None:
    desk = Desk("coded")
    for bit in range(72):
        desk.flip_in_word(17, bit)
        assert desk.copy.check() == 1, bit
        assert desk.is_whole


def test_coded_copy_finds_every_double_error_and_changes_nothing() -> None:
    desk = Desk("coded")
    for bits in combinations(range(72), 2):
        for bit in bits:
            desk.flip_in_word(17, bit)
        assert desk.copy.check() is None, bits
        for bit in bits:
            desk.flip_in_word(17, bit)
    assert desk.is_whole


@given(st.dictionaries(st.integers(0, LENGTH // 8 - 1), st.integers(0, 71), max_size=40))
def test_coded_copy_mends_one_error_in_each_of_many_words(errors: dict[int, int]) -> None:
    desk = CODED
    for word, bit in errors.items():
        desk.flip_in_word(word, bit)
    assert desk.copy.check() == len(errors)
    assert desk.copy.view(LENGTH).tobytes() == desk.image
    assert desk.copy.check() == 0


CODED = Desk("coded")


def test_last_word_that_is_not_whole_is_mended() -> None:
    desk = Desk("coded")
    for bit in (0, 23, 64, 71):  # three bytes of data
        desk.flip_in_word(LENGTH // 8, bit)
        assert desk.copy.check() == 1
        assert desk.is_whole


@given(st.lists(st.integers(0, 8 * LENGTH - 1), min_size=1, max_size=200, unique=True))
def test_redundant_copy_replaces_any_damage(bits: list[int]) -> None:
    desk = REDUNDANT
    for bit in bits:
        desk.flip(CATALOGUE_AT + bit // 8, bit % 8)
    assert desk.copy.check() == len({bit // 64 for bit in bits})
    assert desk.copy.view(LENGTH).tobytes() == desk.image
    assert desk.copy.check() == 0


REDUNDANT = Desk("redundant")


def test_second_copy_is_checked_and_mended_as_well() -> None:
    desk = Desk("redundant")
    desk.flip(SECOND_AT + 5, 1)
    assert desk.copy.check() == 1
    assert desk.is_whole


def test_two_damaged_copies_are_not_mended() -> None:
    desk = Desk("redundant")
    desk.flip(SECOND_AT + 5, 1)
    desk.flip(CATALOGUE_AT + 700, 3)
    assert desk.copy.check() is None


def test_checksum_finds_damage_but_mends_nothing() -> None:
    desk = Desk("checksum")
    desk.flip(CATALOGUE_AT + 700, 3)
    assert desk.copy.check() is None


def test_catalogue_longer_than_half_the_memory_has_no_second_copy() -> None:
    desk = Desk("redundant", SECOND_AT - CATALOGUE_AT + 1)
    assert desk.copy.check() == 0
    desk.flip(CATALOGUE_AT, 0)
    assert desk.copy.check() is None


def test_longest_catalogue_has_room_for_its_check_bytes() -> None:
    assert CATALOGUE_AT + MOST_CATALOGUE_BYTES <= CHECKS_AT
    assert CHECKS_AT + MOST_CATALOGUE_BYTES // 8 <= UPLOAD_AT


def test_check_costs_a_decoded_word_for_each_word_of_the_copy() -> None:
    desk = Desk("coded")
    before = dict(desk.meter.counts)
    desk.flip_in_word(3, 3)
    desk.copy.check()
    spent = {name: count - before.get(name, 0) for name, count in desk.meter.counts.items()}
    words = -(-LENGTH // 8)
    assert (spent["coded_word"], spent["correction"]) == (words, 1)
    assert spent["ram_read"] == 2 * words + -(-words // 4)

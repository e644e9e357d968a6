"""The catalogue in RAM: how damage is found before each use, and mended.

AraMiS thesis, section 2.3.3: RAM should be able to store a redundant or Hamming-coded catalogue. No
printed program does, and the text has no layout, so both are switch ``ram``:

- `checksum`: one copy and its CRC-32; damage is found, and the flash must be read again.
- `redundant`: two copies; one whose CRC-32 is wrong is replaced by the other. Both are checked, as
  damage would gather in one that is not.
- `coded`: one copy, and the check bytes of :mod:`hamming` behind the longest catalogue; single
  errors are corrected in place.

Data stay where a search reads them, so only the check before it has another cost.
"""

from typing import Literal
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.catalogue.hamming import DATA_BYTES, Decoded, mend
from cubestack.firmware_model.aramis.hardware import CATALOGUE_AT, MB, UPLOAD_AT
from cubestack.firmware_model.interface.aramis import MOST_CATALOGUE_BYTES
from cubestack.firmware_model.mcu.costs import Meter

Protection = Literal["checksum", "redundant", "coded"]

SECOND_AT = CATALOGUE_AT + 6 * MB  #: a longer catalogue, of at most twelve, has no second copy
CHECKS_AT = CATALOGUE_AT + MOST_CATALOGUE_BYTES

assert CHECKS_AT + MOST_CATALOGUE_BYTES // DATA_BYTES <= UPLOAD_AT


class RamCopy:
    """The catalogue's bytes in SDRAM."""

    def __init__(self, sdram: NDArray[np.uint8], meter: Meter, protection: Protection) -> None:
        self._sdram, self._meter, self._protection = sdram, meter, protection
        self.length = 0  #: bytes of the good copy
        self._checksum = 0
        self._good, self._good_checks = bytearray(), np.zeros(0, np.uint8)  # what RAM should hold

    def view(self, length: int) -> NDArray[np.uint8]:
        return self._sdram[CATALOGUE_AT : CATALOGUE_AT + length]

    def write(self, first: int, words: Decoded, length: int) -> None:
        """Store words of the flash from byte ``first`` on, of a catalogue of ``length`` bytes."""
        stop = min(length, first + len(words.data))
        self.view(length)[first:stop] = words.data[: stop - first]
        if self._protection == "coded":
            at, count = CHECKS_AT + first // DATA_BYTES, len(words.checks)
            self._sdram[at : at + count] = words.checks
            self._meter.charge(ram_write=-(-count // 4))
        elif self._is_redundant(length):
            self._second(length)[first:stop] = words.data[: stop - first]
            self._meter.charge(ram_write=-(-(stop - first) // 4))

    def accept(self, length: int) -> None:
        """What was written is a good catalogue of ``length`` bytes."""
        self.length, self._good = length, bytearray(self.view(length))
        self._checksum = crc32(self._good)
        self._good_checks = self._checks(length).copy()

    def check(self) -> int | None:
        """Mend damage; the number of words that were wrong, or None if that is not possible."""
        if self._protection == "coded":
            return self._decode()
        copies = [self.view(self.length)]
        if self._is_redundant(self.length):
            copies.append(self._second(self.length))
        right = [self._is_right(copy) for copy in copies]
        if all(right):
            return 0
        if not any(right):
            return None
        good, damaged = copies[right.index(True)], copies[right.index(False)]
        wrong = np.flatnonzero(damaged != good) // DATA_BYTES
        damaged[:] = good
        words = -(-self.length // 4)
        self._meter.charge(ram_read=words, ram_write=words, loop=words)
        return len(np.unique(wrong))

    def _decode(self) -> int | None:
        """Correct single errors, but none if a word has more: it must be loaded again."""
        whole = -(-self.length // DATA_BYTES)
        self._meter.charge(ram_read=2 * whole + -(-whole // 4), coded_word=whole, loop=whole)
        # Words that are as loaded have nothing to correct.
        data, checks = self._words(self.view(self.length)), self._checks(self.length)
        good = self._words(np.frombuffer(self._good, np.uint8))
        same = (data == good).all(axis=1) & (checks == self._good_checks)
        at = np.flatnonzero(~same)
        mended, mended_checks = data[at], checks[at]
        corrected, lost = mend(mended, mended_checks)
        self._meter.charge(correction=len(at), ram_write=corrected)
        if len(lost):
            return None
        data[at], checks[at] = mended, mended_checks
        self.view(self.length)[:] = data.reshape(-1)[: self.length]
        return corrected

    def _words(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Copy (n, 8) of an image, padded with zeros to a whole word as in flash."""
        return np.pad(image, (0, -len(image) % DATA_BYTES)).reshape(-1, DATA_BYTES)

    def _checks(self, length: int) -> NDArray[np.uint8]:
        return self._sdram[CHECKS_AT : CHECKS_AT + -(-length // DATA_BYTES)]

    def _is_redundant(self, length: int) -> bool:
        return self._protection == "redundant" and length <= SECOND_AT - CATALOGUE_AT

    def _second(self, length: int) -> NDArray[np.uint8]:
        return self._sdram[SECOND_AT : SECOND_AT + length]

    def _is_right(self, copy: NDArray[np.uint8]) -> bool:
        self._meter.charge(ram_read=-(-self.length // 4), table_byte=self.length, loop=self.length)
        if self._good == copy.data:  # the fastest comparison; a bytearray compares buffers
            return True
        return crc32(copy.data) == self._checksum

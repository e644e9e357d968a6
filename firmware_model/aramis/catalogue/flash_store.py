"""The catalogue: error-coded in flash, checked and corrected on its way to RAM, reloaded.

AraMiS thesis, sections 2.1 (code against upsets in flash, periodic reloading into RAM) and 2.3.
In flash, all in words of :mod:`hamming`: eight bytes (magic, length), then the image of
:mod:`database`. The copy in RAM (:mod:`ram_copy`) is checked before each use; one that is damaged
beyond mending is loaded again. A reload that finds uncorrectable words keeps the good copy in RAM.
"""

import struct

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.catalogue import hamming
from cubestack.firmware_model.aramis.catalogue.database import Database, DatabaseError
from cubestack.firmware_model.aramis.catalogue.hamming import CODED_BYTES, DATA_BYTES
from cubestack.firmware_model.aramis.catalogue.ram_copy import Protection, RamCopy
from cubestack.firmware_model.aramis.hardware import SECTOR_BYTES, AramisHardware
from cubestack.firmware_model.interface.aramis import MOST_CATALOGUE_BYTES, CatalogueState
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import Pay, ReadTimer, Routine, pause

HEADER = struct.Struct("<4sI")
MAGIC = b"AFLS"

SLICE_WORDS = 8192  #: coded words per step of a load: 5 ms, after which other jobs can run

#: Erasing a sector and programming 16 bits of the M29W320D: typical values of its data sheet.
ERASE_US, PROGRAM_WORD_US = 800_000, 10


def flash_image(image: bytes) -> NDArray[np.uint8]:
    """Content of the flash for a catalogue's ``image``.

    Raises:
        ValueError: if it is longer than the flash.
    """
    if len(image) > MOST_CATALOGUE_BYTES:
        raise ValueError(
            f"a catalogue has at most {MOST_CATALOGUE_BYTES} bytes, not {len(image)}; fewer stars "
            f"per field make it shorter"
        )
    header = HEADER.pack(MAGIC, len(image))
    return np.concatenate([hamming.encode(header), hamming.encode(image)])


class CatalogueStore:
    """Loads, checks and writes the catalogue."""

    def __init__(
        self, hardware: AramisHardware, meter: Meter, protection: Protection = "checksum"
    ) -> None:
        self._hardware = hardware
        self._meter = meter
        self._ram = RamCopy(hardware.sdram, meter, protection)
        self.database: Database | None = None  #: the copy in RAM; None if there is no good one
        self.state = CatalogueState.NOT_LOADED  #: of the copy in RAM
        self.loads = self.failures = 0  #: passes over the flash, and those without a good catalogue
        self.corrected = self.lost = 0  #: words of the latest pass
        self.corrected_total = 0  #: words corrected since power-up, in flash and in RAM
        self.ram_errors = 0  #: how often RAM was found damaged
        self.load_us = 0  #: duration of the latest pass's steps
        self.loaded_us: int | None = None  #: end of the latest pass; None before
        self._at = 0  # next word of the image in the pass
        self._pass_length: int | None = None
        self._pass_corrected = self._pass_lost = self._pass_us = 0

    @property
    def length(self) -> int:
        """Bytes of the image in RAM; 0 without one."""
        return self._ram.length if self.database is not None else 0

    @property
    def loading(self) -> bool:
        return self._pass_length is not None

    def forget(self) -> None:
        self.database, self.state = None, CatalogueState.NOT_LOADED
        self._pass_length = None

    def load(self) -> Routine[bool]:
        """Run a whole pass; returns whether RAM holds a good catalogue after it."""
        self._pass_length = None
        while not (yield from self.load_step()):
            pass
        return self.database is not None

    def load_step(self) -> Routine[bool]:
        """Run a slice of a pass over the flash; returns whether that ended it."""
        started_us: int = yield ReadTimer()
        if self._pass_length is None:
            self._begin()
        else:
            self._slice(self._pass_length)
        ended = self._pass_length is None or self._at * DATA_BYTES >= self._pass_length
        if ended:
            self._finish()
        yield Pay()
        now_us: int = yield ReadTimer()
        self._pass_us += now_us - started_us
        if ended:
            self.load_us, self.loaded_us = self._pass_us, now_us
        return ended

    def ensure(self) -> Routine[bool]:
        """Check RAM, and reload what cannot be mended; returns whether RAM is good."""
        if self.database is None:
            return False
        wrong = self._ram.check()
        yield Pay()
        if wrong == 0:
            return True
        self.ram_errors += 1
        if wrong is not None:
            self.corrected_total += wrong
            return True
        self.forget()
        return (yield from self.load())

    def program(self, image: bytes) -> Routine[None]:
        """Erase the necessary sectors and write ``image``, coded."""
        coded = flash_image(image)
        flash = self._hardware.catalogue_flash
        self._meter.charge(coded_word=len(coded) // CODED_BYTES, loop=len(coded) // CODED_BYTES)
        for start in range(0, len(coded), SECTOR_BYTES):
            sector = coded[start : start + SECTOR_BYTES]
            yield from pause(ERASE_US)
            flash[start : start + SECTOR_BYTES] = 0xFF
            yield from pause(PROGRAM_WORD_US * -(-len(sector) // 2))
            flash[start : start + len(sector)] = sector

    def refresh(self) -> Routine[bool]:
        """Write the good copy of RAM to the flash; False if there is none."""
        if not (yield from self.ensure()):
            return False
        yield from self.program(self._ram.view(self.length).tobytes())
        return True

    def _begin(self) -> None:
        """Read the header and start a pass; one without a header ends at once."""
        self._pass_corrected = self._pass_lost = self._pass_us = self._at = 0
        coded = self._hardware.catalogue_flash[:CODED_BYTES]
        header = hamming.decode(coded, self._meter)
        self._pass_corrected += header.corrected
        self._pass_lost += len(header.lost)
        magic, length = HEADER.unpack(header.data.tobytes())
        if not self._pass_lost and magic == MAGIC and 0 < length <= MOST_CATALOGUE_BYTES:
            self._pass_length = length
        elif (coded == 0xFF).all():
            self._pass_lost = 0  # erased, which is no coded word

    def _slice(self, length: int) -> None:
        """Copy the next words of the image to RAM; lost words do not overwrite a good copy."""
        words = min(SLICE_WORDS, -(-length // DATA_BYTES) - self._at)
        start = CODED_BYTES * (1 + self._at)
        coded = self._hardware.catalogue_flash[start : start + CODED_BYTES * words]
        decoded = hamming.decode(coded, self._meter)
        first = DATA_BYTES * self._at
        if self.database is None or not len(decoded.lost):
            self._ram.write(first, decoded, length)
        self._pass_corrected += decoded.corrected
        self._pass_lost += len(decoded.lost)
        self._at += words

    def _finish(self) -> None:
        length, self._pass_length = self._pass_length, None
        self.loads += 1
        self.corrected, self.lost = self._pass_corrected, self._pass_lost
        self.corrected_total += self.corrected
        if self.database is not None:
            self.failures += bool(self.lost)
            return
        if length is None or self.lost:
            self.failures += 1
            self.state = CatalogueState.DAMAGED if self.lost else CatalogueState.MISSING
            return
        image = self._ram.view(length).data
        self._meter.charge(ram_read=-(-length // 4), table_byte=length, loop=length)
        try:
            self.database = Database.unpack(image)
        except DatabaseError:
            self.failures += 1
            self.state = CatalogueState.DAMAGED
            return
        self.state = CatalogueState.GOOD
        self._ram.accept(length)

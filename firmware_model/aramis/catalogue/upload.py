"""Loading a catalogue by telecommand: blocks into spare RAM, checked, then written to flash.

AraMiS thesis, section 2.2 (inputStarcatalogue). The present catalogue stays unchanged until the new
one has been checked.
"""

from dataclasses import dataclass
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from cubestack.firmware_model.aramis.arrays import Mask
from cubestack.firmware_model.aramis.catalogue.database import Database, DatabaseError
from cubestack.firmware_model.aramis.catalogue.flash_store import CatalogueStore
from cubestack.firmware_model.aramis.hardware import UPLOAD_AT, AramisHardware
from cubestack.firmware_model.interface.aramis import BLOCK_BYTES
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.firmware_model.mcu.requests import Pay, Routine


@dataclass
class CatalogueUpload:
    """The catalogue that is being loaded; ``commit`` writes it to the store."""

    _hardware: AramisHardware
    _meter: Meter
    _store: CatalogueStore

    def __post_init__(self) -> None:
        self.begin(0, 0)

    @property
    def blocks(self) -> int:
        """Number of blocks of the image; 0 if none is being loaded."""
        return len(self._received)

    @property
    def received(self) -> int:
        return int(self._received.sum())

    @property
    def missing(self) -> int:
        """First missing block; ``blocks`` if none is missing."""
        return self.blocks if self._received.all() else int(np.argmin(self._received))

    def begin(self, length: int, checksum: int) -> None:
        """Start the upload of an image of ``length`` bytes with that CRC-32."""
        self._length, self._checksum = length, checksum
        self._received: Mask = np.zeros(-(-length // BLOCK_BYTES), bool)

    def put(self, number: int, data: bytes) -> bool:
        """Store a block; False if it is beyond the image or none is being loaded."""
        if number >= self.blocks:
            return False
        start = number * BLOCK_BYTES
        block = np.frombuffer(data, np.uint8)[: self._length - start]
        self._image()[start : start + BLOCK_BYTES] = block
        self._received[number] = True
        self._meter.charge(ram_write=BLOCK_BYTES // 4, loop=BLOCK_BYTES // 4)
        return True

    def commit(self) -> Routine[bool]:
        """Check the image and write it to flash; False if it is rejected."""
        length, image = self._length, self._image()
        self._meter.charge(ram_read=-(-length // 4), table_byte=length, loop=length)
        yield Pay()
        if not self.blocks or not self._received.all() or crc32(image.data) != self._checksum:
            return False
        data = image.tobytes()
        try:
            Database.unpack(data)
        except DatabaseError:
            return False
        self._store.forget()
        yield from self._store.program(data)
        self.begin(0, 0)
        return True

    def _image(self) -> NDArray[np.uint8]:
        return self._hardware.sdram[UPLOAD_AT : UPLOAD_AT + self._length]

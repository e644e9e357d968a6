"""Memory map: the SDRAM, and the flash chips of the catalogue.

AraMiS thesis, sections 2.3.2 and 2.3.3 and appendix A: 32 MB of SDRAM (MT48LC16M16), flash parts of
4 MB (M29W320D), of which three hold the coded catalogue (assumed, from its size). RAM holds the
image, a second one that is transferred while the first is processed, and the catalogue.
"""

from cubestack.firmware_model.aramis.catalogue.hamming import coded_size
from cubestack.firmware_model.interface.aramis import IMAGE_BYTES, MOST_CATALOGUE_BYTES

MB = 1 << 20

SDRAM_BYTES = 32 * MB
FLASH_BYTES = 12 * MB  # chosen: three of the published parts of 4 MB

SECTOR_BYTES = 1 << 16  #: smallest part of the flash that can be erased

PICTURES_AT = (0, 2 * MB)
CATALOGUE_AT = 4 * MB
UPLOAD_AT = 16 * MB

_ENDS = (
    (PICTURES_AT[0] + IMAGE_BYTES, PICTURES_AT[1]),
    (PICTURES_AT[1] + IMAGE_BYTES, CATALOGUE_AT),
    (CATALOGUE_AT + MOST_CATALOGUE_BYTES, UPLOAD_AT),
    (UPLOAD_AT + MOST_CATALOGUE_BYTES, SDRAM_BYTES),
    (coded_size(8) + coded_size(MOST_CATALOGUE_BYTES), FLASH_BYTES),
)
assert all(end <= limit for end, limit in _ENDS)

"""Pictures in FITS, the format of astronomy (FITS standard 4.0, section 4; with astropy)."""

from io import BytesIO

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.scene.file import SceneError

FITS_START = b"SIMPLE  ="

ADVICE = "a FITS picture needs astropy: install the extra fits"


def read_fits(content: bytes, name: str, most_pixels: int) -> NDArray[np.uint16]:
    """Grey values (rows, columns) of the first image of two axes, the upper row first.

    The first row of a FITS image is the lowest one, unless its keyword ROWORDER is TOP-DOWN.
    Negative values become 0. Raises SceneError for what is no such image, or is too large.
    """
    try:
        from astropy.io import fits
    except ImportError:
        raise SceneError(f"{name}: {ADVICE}") from None
    try:
        with fits.open(BytesIO(content), memmap=False) as units:
            for unit in units:
                sides = [unit.header.get(f"NAXIS{axis}", 0) for axis in (1, 2)]
                if not unit.is_image or unit.header.get("NAXIS") != 2:
                    continue
                if sides[0] * sides[1] > most_pixels:
                    raise SceneError(
                        f"{name} has {sides[0]} x {sides[1]} pixels; accepted are "
                        f"{most_pixels // 10**6} million at most"
                    )
                values = np.asarray(unit.data, np.float64)
                top_down = str(unit.header.get("ROWORDER", "")).strip() == "TOP-DOWN"
                break
            else:
                raise SceneError(f"{name} has no image of two axes")
    except SceneError:
        raise
    except Exception as error:  # damaged data can cause any error in the decoder
        raise SceneError(f"{name} can not be read: {type(error).__name__}") from None
    if not np.all(np.isfinite(values)) or values.max(initial=0) > 0xFFFF:
        raise SceneError(f"{name} has values beyond 0 to 65535; scale it to 16 bits")
    grey = np.clip(values, 0, 0xFFFF).astype(np.uint16)
    return grey if top_down else grey[::-1]

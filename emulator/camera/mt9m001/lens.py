"""Double Gauss lenses of AraMiS' camera unit with its MT9M001.

AraMiS thesis, section 2.3.2 (field of more than 21 degrees in the simulations, 18 of the likely
lens), 3.2 (21.5346 degrees for the height of the simulated camera's window) and 8.2 (only the
circle of that diameter counts; in hardware, the shade covers the rest). The field is therefore the
diameter of a circle inscribed in the image's height, bounded by the shade. Double Gauss lenses do
not distort (section 2.4.2).

Focal length, aperture and transmission are not published. The focal length follows from field and
height. The aperture and the effective width (bandwidth times transmission times quantum efficiency
and fill factor) are assumed: f/1.2, and 3200 Angstrom at 0.55 and 0.85. The width of the spot is
assumed to suit the removal of spikes, which requires 13 of 25 pixels (section 3.5).

The thesis' equation 3.2, the electrons of a star, is replaced by that of `Optics`. Equation 3.2 has
a response in A/W instead of photons, a flux of 10^11.2 without a unit, and multiplies electrons by
a gain in electrons per count. Exposure, magnitude and area enter both in the same way.
"""

import math

from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.common.view import SkyCondition
from cubestack.firmware_model.interface.cameras.mt9m001 import COLUMNS, PIXEL_PITCH_MM, ROWS

PUBLISHED_FIELD_DEG = 21.53463888888889
"""Field of all published simulations and of the published catalogue: chosen."""

LIKELY_FIELD_DEG = 18.0
"""Field of the lens that the thesis expects to be built."""

F_NUMBER = 1.2  # chosen, like the next two
EFFECTIVE_WIDTH_A = 1500.0
SPOT_SIGMA_PX = 1.5


def double_gauss(
    field_deg: float = PUBLISHED_FIELD_DEG,
    *,
    spot_sigma_px: float = SPOT_SIGMA_PX,
    shade: bool = True,
) -> Optics:
    """The lens with a round field that spans the image's height.

    Args:
        field_deg: diameter of the field, 5 to 40, else ValueError.
        spot_sigma_px: standard deviation of a star's spot.
        shade: whether a shade blocks light from outside the field.
    """
    if not 5 <= field_deg <= 40:
        raise ValueError(f"the field must be 5 to 40 deg, not {field_deg:g}")
    focal_mm = ROWS * PIXEL_PITCH_MM / 2 / math.tan(math.radians(field_deg / 2))
    focal_px = focal_mm / PIXEL_PITCH_MM
    return Optics(
        focal_length_mm=focal_mm,
        pixel_pitch_um=1000 * PIXEL_PITCH_MM,
        fx=focal_px,
        fy=focal_px,
        cx=(COLUMNS - 1) / 2,
        cy=(ROWS - 1) / 2,
        psf_sigma_px=spot_sigma_px,
        columns=COLUMNS,
        rows=ROWS,
        aperture_mm=focal_mm / F_NUMBER,
        effective_width_a=EFFECTIVE_WIDTH_A,
        field_stop_deg=field_deg if shade else 360.0,
    )


CONDITION = SkyCondition(double_gauss())

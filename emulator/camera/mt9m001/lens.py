"""Double Gauss lenses of AraMiS' camera unit in front of its MT9M001.

AraMiS thesis, section 2.3.2 (the simulations' field of more than 21 degrees, the likely lens' 18),
3.2 (21.5346 degrees, that of the simulated camera's window: its height) and 8.2 (only what lies in
the circle of that diameter counts; in hardware, the shade covers the rest). So the field is the
diameter of a circle that the picture's height just holds, and the shade ends it. Double Gauss
lenses do not distort (section 2.4.2).

Neither focal length, aperture nor transmission are published. The focal length follows from field
and height. The aperture and the effective width (bandwidth times transmission times quantum
efficiency and fill factor) are assumed: f/1.2, and 3200 Angstrom at 0.55 and 0.85. The spot is
assumed to be set as wide as removing spikes wants it, which asks for 13 of 25 pixels (section 3.5).

The thesis' equation 3.2, the electrons of a star, is replaced by that of `Optics`. It takes no
photons but a response in A/W, has a flux of 10^11.2 without a unit, and its gain is electrons for a
count, by which electrons must not be multiplied. Exposure, magnitude and area count alike in both.
"""

import math

from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.common.view import SkyCondition
from cubestack.firmware_model.interface.cameras.mt9m001 import COLUMNS, PIXEL_PITCH_MM, ROWS

PUBLISHED_FIELD_DEG = 21.53463888888889
"""Of all published simulations and of the published catalogue: chosen of the two."""

LIKELY_FIELD_DEG = 18.0
"""Of the lens that the thesis expects to be built."""

F_NUMBER = 1.2  # chosen, as the next two
EFFECTIVE_WIDTH_A = 1500.0
SPOT_SIGMA_PX = 1.5


def double_gauss(
    field_deg: float = PUBLISHED_FIELD_DEG,
    *,
    spot_sigma_px: float = SPOT_SIGMA_PX,
    shade: bool = True,
) -> Optics:
    """The lens with a round field of ``field_deg``, which the picture's height spans.

    Args:
        field_deg: diameter of the field, 5 to 40.
        spot_sigma_px: standard deviation of a star's spot.
        shade: whether light from beyond the field is kept away.

    Raises:
        ValueError: for a field that is out of range.
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
"""What a camera is like when nothing else is said."""

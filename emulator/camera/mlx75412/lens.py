"""The lens of CubeStar's MLX75412: 6 mm focal length at f/1.2.

CubeStar thesis, section 5.4 (calibration, figure 5.12; focal length by star pairs) and 3.4.4.

The calibration toolbox fits coefficients that map undistorted points to distorted ones. The
firmware uses them with inverted signs in equations that map distorted points to undistorted ones,
which is only approximately the inverse. By default, this lens is the exact inverse of the
firmware's computation, so its calibration is correct. With the other interpretation,
``Distortion.TOOLBOX``, the firmware's undistortion has a mean error of 1.7 px over the image, and
15 px in one corner.
"""

from cubestack.emulator.camera.common.optics import Optics
from cubestack.emulator.camera.common.view import SkyCondition
from cubestack.firmware_model.interface.cameras.mlx75412 import COLUMNS, PIXEL_PITCH_MM, ROWS

EFFECTIVE_WIDTH_A = 4780.0
"""Bandwidth in Angstrom times transmission times quantum efficiency: fitted.

A star of V = 3.8 then has 300 counts of 8 bits, summed over its spot, in the 385.6 ms of the
default frame rate, near the published detection limit. The thesis' factors without a quantum
efficiency range from 0.6 x 3000 to 0.8 x 6000 Angstrom, so this is a bright lens.
"""

LENS = Optics(
    focal_length_mm=6.28,
    pixel_pitch_um=1000 * PIXEL_PITCH_MM,
    fx=1147.5,
    fy=1147.4,
    cx=539.0,
    cy=175.5,
    k1=0.32358,
    k2=-0.12456,
    p1=-0.00414,
    p2=0.00624,
    psf_sigma_px=0.9,  # chosen: spots of the published 9 to 30 px
    columns=COLUMNS,
    rows=ROWS,
    aperture_mm=5.0,  # published
    effective_width_a=EFFECTIVE_WIDTH_A,
)

UNCERTAIN = {
    "focal_length_mm": 0.0029,
    "fx": 39.98968 / 3,
    "fy": 39.61536 / 3,
    "cx": 13.25120 / 3,
    "cy": 15.32062 / 3,
    "k1": 0.01004 / 3,
    "k2": 0.03556 / 3,
    "p1": 0.00163 / 3,
    "p2": 0.00085 / 3,
}
"""Standard deviations of the calibration, by the names of ``Optics``.

Published (figure 5.12), where the toolbox prints three standard deviations; for the focal length,
which is from other tests, the rounding of the printed 6.28 mm. The toolbox fits them together, but
prints no correlations: drawn independently, the errors are larger than with them.
"""

CONDITION = SkyCondition(LENS)

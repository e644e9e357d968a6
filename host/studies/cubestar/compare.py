"""CubeStar for `cubestack compare`."""

import numpy as np

from cubestack.emulator.boards.cubestar.catalogue import MAG_LIMIT
from cubestack.emulator.camera.mlx75412.lens import LENS
from cubestack.emulator.sim.firmware_loops import offer_firmware_loops
from cubestack.firmware_model.cubestar.matching import confirmed
from cubestack.firmware_model.cubestar.matching.voting import DEFAULT_MARGIN_RAD
from cubestack.firmware_model.interface.cubestar.telecommands import MOST_STARS
from cubestack.firmware_model.mcu.cortex_m3 import CORTEX_M3
from cubestack.firmware_model.mcu.costs import Meter
from cubestack.host.studies.compare.tracker import Firmware, Image, Indices, Tracker
from cubestack.host.studies.cubestar.identification import CATALOGUE, FIELD, NOISE_PX

FLASH_BYTES = 1 << 20  #: CubeStar thesis, section 3.2
FALSE_MAG = (2.0, MAG_LIMIT)


def tracker() -> Tracker:
    """Its star list, camera and processor."""
    offer_firmware_loops()

    def identify(image: Image, meter: Meter) -> Indices:
        found = confirmed.identify(image.rays, image.brightness, CATALOGUE, FIELD, meter)
        return found.stars.astype(np.intp)

    database_bytes = CATALOGUE.pair_bytes + CATALOGUE.star_bytes
    return Tracker(
        name="cubestar",
        title="CubeStar",
        optics=LENS,
        view=FIELD,
        stars=CATALOGUE.vectors,
        v_mag=CATALOGUE.v_mag,
        faintest_mag=MAG_LIMIT,
        false_mag=FALSE_MAG,
        noise_px=NOISE_PX,
        margin_rad=DEFAULT_MARGIN_RAD,
        pair_limit_rad=float(np.radians(CATALOGUE.pair_limit_deg)),
        most=MOST_STARS,
        used=MOST_STARS,
        table=CORTEX_M3,
        room_bytes=FLASH_BYTES,
        firmware={"extended": Firmware(identify, database_bytes)},
    )

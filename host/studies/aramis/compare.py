"""AraMiS for `cubestack compare`."""

from dataclasses import replace

import numpy as np

from cubestack.emulator.boards.aramis.catalogue import onboard_database
from cubestack.emulator.camera.mt9m001.lens import CONDITION
from cubestack.emulator.sim.firmware_loops import offer_firmware_loops
from cubestack.firmware_model.aramis.field import CameraField
from cubestack.firmware_model.aramis.matching.identification import identify as own_identify
from cubestack.firmware_model.aramis.solution import Profile, StarList
from cubestack.firmware_model.interface.aramis import INTERFACE, MOST_CATALOGUE_BYTES
from cubestack.firmware_model.mcu.blackfin import BLACKFIN_BF533
from cubestack.firmware_model.mcu.costs import CostTable, Meter
from cubestack.firmware_model.node.state import Settings
from cubestack.host.studies.compare.tracker import Firmware, Image, Indices, Tracker

NOISE_PX = 0.1  #: for which the default of SetIdentification is made (docs/fidelity-aramis.md)
FAINTEST_MAG = 6.0  #: of the catalogue
FALSE_MAG = (3.0, 4.8)
LISTED_STARS = 12  #: of an image: about as many as the list has in a field


def tracker() -> Tracker:
    """Its star list, camera and processor."""
    offer_firmware_loops()
    database, field = onboard_database(), CameraField()
    settings = Settings(INTERFACE, ("SetDetection", "SetIdentification"))
    sigma_rad = float(settings.get("SetIdentification", "Noise")) * field.scale[1]
    profile = Profile(sigma_rad=sigma_rad, verify=True)

    def identify(image: Image, meter: Meter) -> Indices:
        stars = StarList(image.pixels, image.brightness)
        return own_identify(stars, field, profile, database, meter).stars.astype(np.intp)

    return Tracker(
        name="aramis",
        title="AraMiS",
        optics=CONDITION.optics,
        view=field,
        stars=np.asarray(database.vectors),
        v_mag=database.v_mag.astype(np.float64),
        faintest_mag=FAINTEST_MAG,
        false_mag=FALSE_MAG,
        noise_px=NOISE_PX,
        margin_rad=3 * np.sqrt(2) * sigma_rad,
        pair_limit_rad=float(np.radians(database.fov_deg)),
        most=int(settings.get("SetDetection", "MaxStars")),
        used=LISTED_STARS,
        table=_in_ram(BLACKFIN_BF533),
        room_bytes=MOST_CATALOGUE_BYTES,
        firmware={"extended": Firmware(identify, sum(database.sizes.values()))},
    )


def _in_ram(table: CostTable) -> CostTable:
    """The database is read from its copy in RAM (AraMiS thesis, section 2.3.3)."""
    operations = dict(table.operations)
    return replace(table, operations=operations | {"flash_read": operations["ram_read"]})

"""What a device found in a picture, to be drawn over it, and proper names of bright stars.

Pixels are column and row. Names are those of the IAU Working Group on Star Names, by Hipparcos
number.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cubestack.host.clients.contract import DeviceClient

_NAMES = {
    677: "Alpheratz",
    3419: "Diphda",
    5447: "Mirach",
    7588: "Achernar",
    9884: "Hamal",
    11767: "Polaris",
    14576: "Algol",
    15863: "Mirfak",
    21421: "Aldebaran",
    24436: "Rigel",
    24608: "Capella",
    25336: "Bellatrix",
    25428: "Elnath",
    25930: "Mintaka",
    26311: "Alnilam",
    26727: "Alnitak",
    27366: "Saiph",
    27989: "Betelgeuse",
    28360: "Menkalinan",
    30324: "Mirzam",
    30438: "Canopus",
    31681: "Alhena",
    32349: "Sirius",
    33579: "Adhara",
    34444: "Wezen",
    36850: "Castor",
    37279: "Procyon",
    37826: "Pollux",
    41037: "Avior",
    45238: "Miaplacidus",
    46390: "Alphard",
    49669: "Regulus",
    50583: "Algieba",
    54061: "Dubhe",
    57632: "Denebola",
    60718: "Acrux",
    61084: "Gacrux",
    62434: "Mimosa",
    62956: "Alioth",
    65474: "Spica",
    67301: "Alkaid",
    68702: "Hadar",
    69673: "Arcturus",
    71683: "Rigil Kentaurus",
    72607: "Kochab",
    80763: "Antares",
    82273: "Atria",
    85927: "Shaula",
    86032: "Rasalhague",
    86228: "Sargas",
    90185: "Kaus Australis",
    91262: "Vega",
    92855: "Nunki",
    97649: "Altair",
    100751: "Peacock",
    102098: "Deneb",
    109268: "Alnair",
    113368: "Fomalhaut",
}


def is_named(hipparcos: int) -> bool:
    return hipparcos in _NAMES


def star_name(hipparcos: int) -> str:
    """Proper name of a star, or its Hipparcos number."""
    return _NAMES.get(hipparcos, f"HIP {hipparcos}")


@dataclass(frozen=True)
class Mark:
    """A place: what it is, empty where the device does not know; a star's Hipparcos number."""

    x_px: float
    y_px: float
    name: str = ""
    hipparcos: int | None = None


@dataclass(frozen=True, eq=False)
class Overlay:
    """Places, and lines of points (n, 2)."""

    marks: Sequence[Mark] = ()
    lines: Sequence[NDArray[np.float64]] = ()


def star_overlay(client: DeviceClient, _picture: str) -> Overlay:
    """Stars of the latest picture, wherever that lies; raises the client's errors."""
    return Overlay(
        [
            Mark(star.x_px, star.y_px, name, star.hipparcos)
            for star in client.stars()
            for name in ["" if star.hipparcos is None else star_name(star.hipparcos)]
        ]
    )

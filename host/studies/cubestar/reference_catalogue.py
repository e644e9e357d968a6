"""The star catalogue as C, for CubeStar's reference firmware: star list, pair list, constants.

    python -m cubestack.host.studies.cubestar.reference_catalogue FOLDER

writes ``catalogue_tables.h`` and ``catalogue_tables.c``: the catalogue that the emulated node has
in its flash, cut to the published pair limit.
"""

import argparse
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.boards.cubestar.catalogue import MAG_LIMIT, onboard_catalogue
from cubestack.emulator.scene.hipparcos import DEFAULT_EPOCH
from cubestack.firmware_model.cubestar.matching import tracking, voting
from cubestack.firmware_model.interface.cubestar.switches import CubeStarSwitches
from cubestack.host.export.c_header import c_arrays

#: Number of directions, about 2.9 deg apart, for counting the reduced pair list; and the margin for
#: directions between them.
DIRECTIONS, SPARE = 5000, 0.03


def catalogue_tables(epoch: float | None = None) -> dict[str, str]:
    """Texts of the two files by name; ``epoch`` is a Julian year (default: the device's)."""
    published = CubeStarSwitches()
    epoch = DEFAULT_EPOCH if epoch is None else epoch
    widest = max(map(float, CubeStarSwitches.declared()["pair_limit"].choices))
    flown = onboard_catalogue(pair_limit_deg=widest, epoch=epoch)
    catalogue = flown.with_pair_limit(float(published.pair_limit))
    cut_deg, tracked_deg = voting.CUT_RADIUS_DEG, float(published.reduction)
    about = (
        f"CubeStar's catalogue: V < {MAG_LIMIT:g}, pairs closer than {published.pair_limit} deg, "
        f"epoch {epoch:g}; generated, SHA-256 {catalogue.sha256()}"
    )
    arrays = catalogue.arrays()
    stars = {name[5:]: arrays[name] for name in ("star_x", "star_y", "star_z")}
    pairs = {name[5:]: arrays[name] for name in ("pair_first", "pair_second", "pair_angle")}
    stars["hip"] = catalogue.hip.astype("<u4")
    reach = 2 * math.sin(math.radians(tracking.REACH_DEG) / 2)
    most = _largest_reduction(catalogue.vectors, pairs["first"], pairs["second"], cut_deg)
    header = [
        f"/* {about} */",
        "#ifndef CATALOGUE_TABLES_H",
        "#define CATALOGUE_TABLES_H",
        "",
        f"#define STAR_COUNT {len(catalogue)}",
        f"#define PAIR_COUNT {len(catalogue.pairs)}",
        f"#define REDUCED_PAIRS {most} /* the most that a reduced catalogue holds */",
        f"#define CUT_COSINE {_hex(math.cos(math.radians(cut_deg)))} /* {cut_deg:g} deg */",
        f"#define TRACKING_COSINE {_hex(math.cos(math.radians(tracked_deg)))}"
        f" /* {tracked_deg:g} deg */",
        f"#define REACH_CHORD2 {_hex(reach**2)} /* square of the chord of"
        f" {tracking.REACH_DEG:g} deg */",
        "",
        "#endif",
    ]
    return {
        "catalogue_tables.h": "\n".join(header) + "\n",
        "catalogue_tables.c": c_arrays("star", stars, about)
        + "\n"
        + c_arrays("pair", pairs, about),
    }


def _hex(value: float) -> str:
    """A C literal of the float32 nearest to ``value``, to the bit."""
    return f"{float(np.float32(value)).hex()}f"


def _largest_reduction(
    vectors: NDArray[np.float32],
    first: NDArray[np.generic],
    second: NDArray[np.generic],
    radius_deg: float,
) -> int:
    """Largest number of pairs of the reduced catalogue, with a margin."""
    step = np.arange(DIRECTIONS) + 0.5
    z = 1 - 2 * step / DIRECTIONS  # on a spiral from pole to pole
    turn, radius = step * np.pi * (3 - np.sqrt(5)), np.sqrt(1 - z * z)
    directions = np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=1)
    near = vectors @ directions.T >= math.cos(math.radians(radius_deg))
    most = max(int(np.count_nonzero(column[first] & column[second])) for column in near.T)
    return math.ceil(most * (1 + SPARE))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folder", type=Path)
    folder: Path = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in catalogue_tables().items():
        (folder / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()

"""The picture in a device's memory as a PNG file, for any device that sends one."""

from pathlib import Path

from cubestack.firmware_model.interface.cubesense.codes import ImageSize, Sram
from cubestack.host.clients.aramis.client import Aramis
from cubestack.host.clients.cubesense.download import download_image, picture_of
from cubestack.host.clients.cubestar.client import CubeStar
from cubestack.host.clients.node import NodeClient
from cubestack.host.devices.targets import Target
from cubestack.host.errors import TargetError
from cubestack.host.pictures.frames import save_picture

__all__ = ["download"]


def download(target: Target, path: Path, source: str | None) -> tuple[int, int]:
    """Write the picture to ``path``; returns (rows, columns).

    ``source`` is a memory of a CubeSense (SRAM1, SRAM2; default SRAM1). Raises TargetError for a
    device or source that has no picture, and the client's errors.
    """
    name = target.interface.name
    if name == "CubeStar" and source is None:
        picture = CubeStar(target.node).download_image()
    elif name == "AraMiS" and source is None:
        if not isinstance(target.node, NodeClient):
            raise TargetError("image: AraMiS sends its picture over a serial line only")
        picture = Aramis(target.node).image()
    elif name == "CubeSense":
        memories = {sram.name.lower(): sram for sram in Sram}
        if source is not None and source.lower() not in memories:
            raise TargetError(f"image: no memory {source!r}; known: {', '.join(memories)}")
        sram = memories[(source or Sram.SRAM1.name).lower()]
        picture = picture_of(download_image(target.node, sram, max(ImageSize, key=_side)))
    else:
        raise TargetError(f"image: {name} sends no picture" + (f" {source!r}" if source else ""))
    save_picture(picture, path)
    rows, columns = picture.shape
    return rows, columns


def _side(size: ImageSize) -> int:
    return size.side

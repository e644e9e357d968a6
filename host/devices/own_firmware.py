"""Options of every device whose processor runs a user's own firmware."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from cubestack.host.devices.device import FILE, BoardOption

if TYPE_CHECKING:
    from cubestack.emulator.boards.own_firmware import OwnFirmwareBoard
    from cubestack.emulator.iss.image import Image

FIRMWARE = BoardOption(
    "firmware",
    "program for the processor: an ELF, Intel HEX, S-record or UF2 file, or raw bytes "
    "(docs/how-to/own-firmware.md)",
    default="",
    metavar=FILE,
    unset="none",
)

#: Beside ``FIRMWARE``, which devices with other programs declare in their own way.
FIRMWARE_OPTIONS = (
    BoardOption(
        "firmware_base",
        "address of the first byte of --firmware, which is raw bytes",
        default="",
        metavar="ADDRESS",
        unset="not raw bytes",
    ),
    BoardOption(
        "semihosting",
        "handle semihosting calls (BKPT 0xAB) of --firmware; without it they are faults",
    ),
    BoardOption(
        "semihosting_root",
        "folder with the files that semihosting may open, in it and nowhere else; without it "
        "all are refused",
        default="",
        metavar="FOLDER",
        unset="no files",
    ),
    BoardOption(
        "serial",
        "lead a serial block of --firmware's processor, at these pins, to a pseudo-terminal or a "
        "TCP port; may be repeated",
        default="",
        metavar="BLOCK@TX,RX[:PATH|PORT]",
        unset="the board's own lines",
        repeats=True,
        serves=True,
    ),
)

BoardT = TypeVar("BoardT", bound="OwnFirmwareBoard")


@dataclass(frozen=True)
class OwnFirmware:
    """Values of these options; empty ones are not given."""

    firmware: str = ""
    firmware_base: str = ""
    semihosting: bool = False
    semihosting_root: str = ""
    serial: str = ""

    @classmethod
    def of(cls, given: dict[str, Any]) -> "OwnFirmware":
        """Take the options out of ``given``."""
        own = {one.name: given.pop(one.name) for one in fields(cls) if one.name in given}
        return cls(**own)

    def check_unused(self) -> None:
        """Raise ValueError for an option that needs own firmware, where there is none."""
        for name, value in vars(self).items():
            if value:
                what = name.replace("_", " ")
                raise ValueError(f"{what} needs own firmware; choose an image with firmware")

    def power_up(
        self,
        start: "Callable[[Image], BoardT]",
        shipped: "Callable[[str], Path | None]" = lambda _name: None,
    ) -> BoardT:
        """The board that ``start`` powers up with the image.

        ``shipped`` returns the file of an image of ours by its name, None for a user's file. Raises
        ValueError for a file that is no program of the part, and for options that make no sense.
        """
        from cubestack.emulator.iss.image import load_image

        root = Path(self.semihosting_root) if self.semihosting_root else None
        if root is not None and not root.is_dir():
            raise ValueError(f"semihosting root {str(root)!r} is not a folder; create it")
        name, mark, wanted = self.firmware.partition("#")
        own = shipped(name)
        if own is not None:
            image = load_image(f"{own}{mark}{wanted}")
        else:
            image = load_image(self.firmware, base=self._base())
        board = start(image)
        board.firmware = name + image.mark
        if self.semihosting or root is not None:
            board.enable_semihosting(root)
        return board

    def _base(self) -> int | None:
        if not self.firmware_base:
            return None
        try:
            return int(self.firmware_base, 0)
        except ValueError:
            wrong = f"firmware base {self.firmware_base!r}"
            raise ValueError(f"{wrong} is no address, such as 0x0") from None


def firmware_option(more: str, **how: Any) -> BoardOption:
    """``FIRMWARE`` of a device that also has programs of ours; ``more`` names them."""
    head, _, page = FIRMWARE.meaning.rpartition(" (")
    return replace(FIRMWARE, meaning=f"{head}, {more} ({page}", **how)

"""The EFM32GG280F1024 alone, as a registered part."""

from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.host.devices.device import FILE, BoardOption, Device, Engine
from cubestack.host.devices.own_firmware import FIRMWARE, FIRMWARE_OPTIONS, OwnFirmware
from cubestack.host.devices.registry import get
from cubestack.host.errors import TargetError

if TYPE_CHECKING:
    from cubestack.emulator.boards.efm32gg.board import Efm32ggBoard
    from cubestack.host.clients.contract import DeviceClient

NAME = "efm32gg"

STIMULUS = BoardOption(
    "stimulus",
    "levels at pins over time: a VCD file with variables PA0 to PF15 (docs/how-to/bare-part.md)",
    default="",
    metavar=FILE,
    unset="nothing drives the pins",
)


class NoErrors(IntEnum):
    """Without messages, there are no acknowledges of them."""


def _open_board(
    _scene: None,
    *,
    engine: Engine = "auto",
    baud: int | None = None,
    stimulus: str = "",
    **options: Any,
) -> "Efm32ggBoard":
    from cubestack.emulator.boards.efm32gg.board import BAUD, Efm32ggBoard
    from cubestack.emulator.boards.efm32gg.stimulus import Stimulus

    if engine != "auto":
        raise ValueError(f"{NAME} has no FPGA: leave --engine {engine} out")
    own = OwnFirmware.of(options)
    if not own.firmware:
        raise ValueError(f"{NAME} has no program of its own; give yours with --firmware FILE")
    options["serial"] = own.serial
    options["stimulus"] = Stimulus.load(Path(stimulus)) if stimulus else None
    return own.power_up(lambda image: Efm32ggBoard(image, baud=baud or BAUD, **options))


def _no_scene(path: Path) -> NoReturn:
    raise ValueError(f"{NAME} has no camera; leave the scene {path} out")


def _no_client(_client: object) -> "DeviceClient":
    raise TargetError(f"{NAME} has no messages of its own; use its serial lines and pins")


DEVICE: "Device[Efm32ggBoard, DeviceClient]" = Device(
    name=NAME,
    title="EFM32GG",
    summary="the microcontroller alone, with your firmware",
    interface=Interface(NAME, 0, 0, 115_200, (), (), NoErrors),
    client=_no_client,
    open_board=_open_board,
    load_scene=_no_scene,
    default_scene=lambda: None,
    default_scene_title="none",
    has_fpga=False,
    options=(FIRMWARE, *FIRMWARE_OPTIONS, STIMULUS),
    processor=get("cubestack.firmware_model.interface.efm32gg.bare:PROCESSOR"),
)

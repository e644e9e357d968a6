"""The declaration of a device that is a plain node: its parts follow from its board."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.host.clients.derived import client_type
from cubestack.host.devices.device import AnyDevice, Device
from cubestack.host.devices.lazily import call, get, load


def node_device(
    interface: Interface,
    summary: str,
    *,
    written_for: int,
    board: str,
    experiment: str,
    client: str = "",
    tops: str = "",
    proofs: str = "",
    **more: Any,
) -> AnyDevice:
    """Declare a device whose board is a `NodeBoard` and whose scenes are `DeclaredScene`.

    Nothing but the interface is loaded before it is used: parts are named by texts like
    "package.module:NAME".

    Args:
        interface: its messages; the device's name is the interface's in small letters.
        summary: one phrase for lists.
        written_for: version of `cubestack.sensor`.
        board: class of the board.
        experiment: what `cubestack measure` does with it.
        client: class of its client; by default one with a method for each message.
        tops: tops of its FPGAs, and blocks, by name; a device with an FPGA has some.
        proofs: formal properties of its FPGAs by name.
        more: further attributes of `Device`.

    Raises ValueError as `Device` does.
    """

    def scene_type() -> Any:
        return load(board).scene_type

    def load_scene(path: Path) -> Any:
        return scene_type().load(path)

    parts: dict[str, Callable[..., Any]] = {"tops": get(tops)} if tops else {}
    parts |= {"proofs": get(proofs)} if proofs else {}
    declared: dict[str, Any] = {
        "name": interface.name.lower(),
        "title": interface.name,
        "client": call(client) if client else client_type(interface),
        "open_board": call(board),
        "load_scene": load_scene,
        "default_scene": lambda: scene_type()(),
        "default_scene_title": f"the default scene of {interface.name}",
        "scene_form": lambda: scene_type().form(),
        "experiment": get(experiment),
        "has_fpga": bool(tops),
    }
    declared |= {"interface": interface, "summary": summary, "written_for": written_for}
    return Device(**{**declared, **parts, **more})

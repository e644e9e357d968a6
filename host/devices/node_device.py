"""The declaration of a device that is a plain node: parts follow from its board and interface."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from cubestack.firmware_model.interface.codec.field import InterfaceError, Value
from cubestack.firmware_model.interface.codec.message import Interface, Message, MessageKind
from cubestack.host.clients.contract import DeviceClient
from cubestack.host.devices.device import AnyDevice, Device
from cubestack.host.devices.registry import call, get, load


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


WORD_START = re.compile(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")


def client_type(interface: Interface) -> type[DeviceClient]:
    """The class of a device's client, with methods in small letters: SetSamples is set_samples().

    A telecommand takes its parameters by position or by name, and waits until it is done;
    telemetry returns its fields by name. Both raise the errors of `Client`. A message whose name a
    `DeviceClient` uses already is left to ``client``.
    """
    methods: dict[str, Any] = {"__doc__": f"A {interface.name} as a program uses it."}
    for message in interface.messages:
        name = WORD_START.sub("_", message.name).lower()
        if message.supported and name not in methods and not hasattr(DeviceClient, name):
            is_command = message.kind is MessageKind.TELECOMMAND
            method = _command(message) if is_command else _telemetry(message)
            method.__name__, method.__doc__ = name, message.meaning
            methods[name] = method
    return type(interface.name, (DeviceClient,), methods)


def _command(message: Message) -> Callable[..., None]:
    names = [field.name for field in message.fields]

    def perform(self: DeviceClient, *values: object, **named: object) -> None:
        if len(values) > len(names):
            raise InterfaceError(f"{message.name} takes {len(names)} values, not {len(values)}")
        self.perform(message.name, **dict(zip(names, values, strict=False)), **named)

    return perform


def _telemetry(message: Message) -> Callable[[DeviceClient], dict[str, Value]]:
    return lambda self: self.client.telemetry(message.name)

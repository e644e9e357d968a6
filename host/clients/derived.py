"""Clients that follow from an interface: a method for each telecommand and telemetry message."""

import re
from collections.abc import Callable
from typing import Any

from cubestack.firmware_model.interface.codec.field import InterfaceError, Value
from cubestack.firmware_model.interface.codec.message import Interface, Message, MessageKind
from cubestack.host.clients.contract import DeviceClient

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

"""Settings with their defaults, registers and their bits, for the page."""

from collections.abc import Iterator

from cubestack.firmware_model.interface.cameras.registers import CameraRegister
from cubestack.firmware_model.interface.codec.register_pointer import PointerRegister
from cubestack.host.clients.contract import Client
from cubestack.host.devices.device import AnyDevice
from cubestack.host.devices.shown_settings import settings
from cubestack.host.errors import BadAnswerError, TargetError
from cubestack.host.export.field_text import field_details, field_json, picked
from cubestack.host.ground.emulation import JsonObject

SELECT, SELECTED = "SelectCameraRegister", "CameraRegister"
"""Telecommand that selects a register of the image sensor, telemetry with its value."""

PROCESSED_S = 10.0
"""Time-out of a register read, virtual time in s."""


def setting_rows(device: AnyDevice) -> list[JsonObject]:
    """Settings in telemetry, with their telecommand, frame and default."""
    return [
        {
            "telecommand": one.telecommand.name,
            "parameter": one.parameter.name,
            "frame": one.frame.name,
            "field": one.shown.name,
            "type": one.parameter.type,
            "unit": one.parameter.unit,
            "default": field_json(one.parameter)["reset"],
            "details": field_details(one.parameter),
        }
        for one in settings(device.interface, device.conformance)
        if one.frame.name != SELECTED
    ]


def pointer_row(register: PointerRegister) -> JsonObject:
    return {
        "name": register.name,
        "address": register.address,
        "access": register.access.value,
        "reads": register.readable and not register.streams,
        "default": None if register.streams else register.field.reset,
        "unit": register.field.unit,
        "details": field_details(register.field),
    }


def sensor_rows(device: AnyDevice) -> list[JsonObject]:
    """Registers of the image sensor; empty if single ones can not be read."""
    return [_sensor_row(one) for one in device.image_sensor or ()]


def _sensor_row(register: CameraRegister) -> JsonObject:
    about = picked(register, "name", "address", "meaning")
    about["bits"] = [picked(bits, "name", "lsb", "width", "meaning") for bits in register.fields]
    shown = register.reset.to_bytes(-(-register.width * register.unit_bits // 8), "big").hex()
    return about | {"access": register.access.value, "default": shown}


def read_sensor_register(device: AnyDevice, client: Client, name: str) -> JsonObject:
    """A register of the image sensor: ``value`` in hexadecimal, ``bits`` by name.

    Raises TargetError for an unknown name or if single ones can not be read, and client errors.
    """
    if device.image_sensor is None:
        raise TargetError(f"{device.title} can not read single registers of its image sensor")
    known = {one.name: one for one in device.image_sensor}
    if name not in known:
        raise TargetError(f"{device.image_sensor.camera} has no register {name!r}")
    register, value = known[name], 0
    for part in _parts(client, register):
        value = value << register.unit_bits | part
    digits = register.width * register.unit_bits // 4
    bits = {one.name: one.of(value) for one in register.fields}
    return {"value": f"{value:0{digits}x}", "bits": bits}


def _parts(client: Client, register: CameraRegister) -> Iterator[int]:
    for address in register.addresses:
        client.command(SELECT, Address=address)
        client.wait_processed(PROCESSED_S)
        shown = client.telemetry(SELECTED)
        if not shown["Valid"] or shown["Address"] != address:
            raise BadAnswerError(f"the image sensor does not answer at {address:#06x}")
        yield int(shown["Value"])

"""SunSlit as a registered device: the entry point leads here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cubestack.host.devices.device import Device
from cubestack.host.devices.lazily import call, get
from linear_sun_sensor.interface import INTERFACE

if TYPE_CHECKING:
    from linear_sun_sensor.board import SunSlitBoard
    from linear_sun_sensor.client import SunSlit

DEVICE: Device[SunSlitBoard, SunSlit] = Device(
    name="sunslit",
    title="SunSlit",
    summary="angle of the Sun behind a slit",
    interface=INTERFACE,
    client=call("linear_sun_sensor.client:SunSlit"),
    open_board=call("linear_sun_sensor.board:SunSlitBoard"),
    load_scene=call("linear_sun_sensor.scene:load_scene"),
    scene_form=call("linear_sun_sensor.scene:scene_form"),
    default_scene=call("linear_sun_sensor.scene:SlitScene"),
    default_scene_title="the Sun at 12 degrees",
    experiment=get("linear_sun_sensor.experiment:EXPERIMENT"),
    tops=get("linear_sun_sensor.top:TOPS"),
    proofs=get("linear_sun_sensor.proofs:PROOFS"),
)

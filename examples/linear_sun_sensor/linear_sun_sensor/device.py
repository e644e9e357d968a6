"""SunSlit as a registered device: the entry point leads here."""

from cubestack.sensor import node_device
from linear_sun_sensor.interface import INTERFACE

DEVICE = node_device(
    INTERFACE,
    "angle of the Sun behind a slit",
    written_for=1,
    client="linear_sun_sensor.client:SunSlit",
    board="linear_sun_sensor.board:SunSlitBoard",
    default_scene_title="the Sun at 12 degrees",
    experiment="linear_sun_sensor.experiment:EXPERIMENT",
    tops="linear_sun_sensor.top:TOPS",
    proofs="linear_sun_sensor.proofs:PROOFS",
)

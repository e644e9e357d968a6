"""Formal properties of SunSlit's FPGA, from those that all frame buffers share."""

from types import SimpleNamespace

from amaranth.hdl import Module

from cubestack.sensor import (
    Proof,
    StuckWire,
    idle_is_reset,
    outputs_rest,
    starts_in,
    written_is_driven,
)
from linear_sun_sensor.pins import CLK, PINS
from linear_sun_sensor.top import SunSlitTop


def _make(_small: bool) -> tuple[SunSlitTop, None]:
    return SunSlitTop(), None


def _idle(m: Module, d: SimpleNamespace) -> None:
    outputs_rest(m, d, ~d.ENABLE, PINS, but=(CLK,))
    idle_is_reset(m, d, ~d.ENABLE, set())


def _one_driver(m: Module, d: SimpleNamespace) -> None:
    starts_in(m, ~d.ENABLE)
    written_is_driven(m, d)


PROOFS = {
    "sunslit-idle": Proof(
        "With ENABLE low every register is reset, and every output but the array's clock rests",
        _make,
        _idle,
        StuckWire("writer.osc_rst", 0),
    ),
    "sunslit-drivers": Proof(
        "FPGA and SRAM never both drive the SRAM's data bus",
        _make,
        _one_driver,
        StuckWire("writer.store", 1),
    ),
}

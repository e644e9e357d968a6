from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from amaranth.hdl import Fragment

from cubestack.emulator.boards.cubesense.wiring import cubesense_wiring
from cubestack.emulator.boards.cubestar.wiring import cubestar_wiring
from cubestack.emulator.rtl.factory import make_engine
from cubestack.emulator.rtl.wiring import BusPins
from cubestack.emulator.sim.fpga_port import STEPS, Transactions
from cubestack.firmware_model.mcu.external_bus import EBI
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubestar.top import CubeStarTop

from .pair_board import CONTROLS, SIZES, stores

PAIR = cubesense_wiring(CubeSensePair(SIZES[0]))
STAR = cubestar_wiring(CubeStarTop(3, 2))
ADDRESSING = cubesense_wiring(CubeSensePair(SIZES[0], mcu_addressing=True))

# Amaranth complains of a design that was never made.
for wiring in (PAIR, STAR, ADDRESSING):
    Fragment.get(wiring.component, None)


def test_every_input_has_one_driver():
    for wiring in (PAIR, STAR, ADDRESSING):
        memory_inputs = [memory["D_I"] for memory in wiring.memories]
        driven = [*wiring.camera_pins, *wiring.mcu_pins, *memory_inputs]
        assert sorted(driven) == sorted(wiring.initial)
        assert {*wiring.initial}.isdisjoint(wiring.output_pins)
    assert PAIR.initial["SUNEN"] == PAIR.initial["NADEN"] == 1


def test_mcu_address_pins_exist_only_with_the_addressing_option():
    assert "DATA_I" not in PAIR.mcu_pins
    assert "DATA_I" in ADDRESSING.mcu_pins
    assert ADDRESSING.widths["DATA_I"] == 8


def test_camera_is_stored_only_for_store_levels_until_its_acknowledge():
    cameras = [("sun",), ("nadir",), ("sun", "nadir"), ("sun",), ("nadir",)]
    used = {levels: names for (levels, _), names in zip(stores(), cameras, strict=True)}
    memories = dict(stores())
    for levels in product((0, 1), repeat=5):
        pins = dict(zip(CONTROLS, levels, strict=True)) | {"SUNACK": 0, "NADACK": 0}
        assert tuple(PAIR.storing(pins.__getitem__)) == used.get(levels, ())
        for memory in memories.get(levels, ()):
            pins["SUNACK" if memory == "sun" else "NADACK"] = 1
        assert not PAIR.storing(pins.__getitem__)


@pytest.mark.parametrize("kind", ["compiled", "python"])
def test_engine_rejects_unknown_names_and_levels(kind):
    engine = make_engine(PAIR, kind)
    with pytest.raises(ValueError, match="unknown camera moon; cameras: sun, nadir"):
        engine.attach(None, "moon")
    with pytest.raises(ValueError, match="unknown memory moon; memories: sun, nadir"):
        engine.power_memory("moon", False)
    with pytest.raises(ValueError, match="SUNEN has 1 bits, too few for 2"):
        engine.set_pin("SUNEN", 2)
    with pytest.raises(ValueError, match="stop on DATA, only on SUNACK or NADACK"):
        engine.run(1, ("DATA", 1))
    assert np.shares_memory(engine.sram, engine.memories["sun"])


class Device:
    """A memory with an address latch on the lines of the external bus."""

    def __init__(self, pins):
        self.pins, self.lines = pins, {pins.read: 1, pins.write: 1, pins.latch: 0}
        self.lines |= dict.fromkeys(pins.selects, 1) | {pins.high: 0, f"{pins.low}_I": 0}
        self.latched = 0
        self.strobes: list[tuple[str, str, int, int]] = []

    def event(self, levels):
        """The lines go to ``levels``; the strobe counts when it rises, with what is selected."""
        before, self.lines = self.lines, {**self.lines, **dict(levels)}
        pins, low = self.pins, self.lines[f"{self.pins.low}_I"]
        if self.lines[pins.latch]:
            self.latched = self.lines[pins.high] << 8 | low
        for strobe in (pins.read, pins.write):
            if self.lines[strobe] and not before[strobe]:
                (select,) = [pin for pin in pins.selects if not self.lines[pin]]
                address = self.latched << 8 | self.lines[pins.high]
                self.strobes.append((select, strobe, address, low))


@pytest.mark.parametrize("write", [False, True])
@pytest.mark.parametrize("select", [0, 1])
def test_ebi_pin_sequence_matches_the_address_latch_and_memory(write, select):
    pins = BusPins(("A_CS", "B_CS"), "AH", "AL", "ALE", "RE", "WE")
    addresses = np.array([0x123456, 0x00FF01, 0xABCDEF, 0], np.int32)
    data = np.array([0x5A, 1, 0xFF, 0x80], np.uint8)
    one = Transactions(addresses, data, write, Fraction(1), EBI.cycles, select)
    device = Device(pins)
    for event in range(len(one) * STEPS):
        levels = pins.levels(one, event)
        assert {name for name, _ in levels} <= device.lines.keys()
        device.event(levels)
        if event % STEPS == STEPS - 1:  # all is as before, and nothing selected
            assert [device.lines[pin] for pin in (*pins.selects, "RE", "WE", "ALE")] == [
                1,
                1,
                1,
                1,
                0,
            ]
    kept = [address >> 8 & 0xFF for address in addresses.tolist()]
    low = data.tolist() if write else kept
    expected = [
        (pins.selects[select], "WE" if write else "RE", address, byte)
        for address, byte in zip(addresses.tolist(), low, strict=True)
    ]
    assert device.strobes == expected

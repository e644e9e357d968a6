"""The bare part with a user's firmware: processor, flash, RAM, serial blocks and port pins.

Its supply is ideal, and nothing is connected to its pins but serial lines and what a stimulus or a
test drives. An I2C master gets no acknowledge.
"""

from typing import Unpack

from cubestack.emulator.boards.contract import BoardOptions
from cubestack.emulator.boards.efm32gg.stimulus import Stimulus
from cubestack.emulator.boards.firmware import ASKING, FLOATING
from cubestack.emulator.boards.own_firmware import OwnFirmwareBoard
from cubestack.emulator.boards.pins import Pins
from cubestack.emulator.boards.serial_routes import parse_routes
from cubestack.emulator.iss.image import Image
from cubestack.emulator.iss.outcome import Outgoing, OutgoingKind
from cubestack.emulator.sim.power import Part, PowerTable

VOLTS, TEMPERATURE_C = 3.3, 25.0
TEMPERATURE, SUPPLY = 8, 9
"""Analog inputs: see efm32gg/part/part.h."""

STARTER_KIT = "uart0@PE0,PE1"
"""Serial lines by default: that of the starter kit's board controller (EFM32GG-STK3700, UG50)."""

BAUD = 115_200
"""Of the host's end until the firmware sends, which the starter kit's examples use too."""

SUPPLIES = PowerTable(VOLTS, {"processor": Part(None, {"sleep": 2.4, "run": 9.6})}, {})
"""Chosen: data sheet, 200 uA/MHz running and 50 uA/MHz asleep at 48 MHz."""


class Efm32ggBoard(OwnFirmwareBoard):
    """One emulated part."""

    pins: Pins

    def __init__(
        self,
        image: Image,
        *,
        serial: str = "",
        stimulus: Stimulus | None = None,
        baud: int = BAUD,
        **common: Unpack[BoardOptions],
    ) -> None:
        """Power up.

        Args:
            image: program in the flash.
            serial: serial blocks led out, see ``parse_routes``; by default `STARTER_KIT`.
            stimulus: levels at pins over time.
            baud: rate of the host's ends until the firmware sends.
            common: seed, kernel and i2c_bus, see ``Board``.
        """
        super().__init__(SUPPLIES, **common)
        self._load(image)
        self.machine.analog[TEMPERATURE], self.machine.analog[SUPPLY] = TEMPERATURE_C, VOLTS
        nobody = dict.fromkeys(ASKING, self._answer_nothing)
        self._start({OutgoingKind.PIN: lambda one: self.pins.changed(one), **nobody}, baud)
        self.pins = Pins(self.processor)
        for route in parse_routes(serial or STARTER_KIT):
            self._lead_out(route, baud)
        if stimulus is not None:
            self.kernel.process(stimulus.applied(self.kernel, self.pins))

    @property
    def scene(self) -> None:
        """Always None."""
        return None

    @scene.setter
    def scene(self, scene: object) -> None:
        if scene is not None:
            raise TypeError(f"a bare part has no camera; leave the scene {scene!r} out")

    def _answer_nothing(self, one: Outgoing) -> None:
        self.machine.i2c_answer(one.unit & 0xFF, False, FLOATING)

"""A board that runs a user's own firmware: what is the same on all of them.

A subclass also inherits the board around the processor, and handles its pins and buses.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from cubestack.emulator.boards.contract import Board
from cubestack.emulator.boards.firmware import Core, Insight, SerialWire
from cubestack.emulator.boards.monitor import Camera
from cubestack.emulator.boards.serial_routes import SerialRoute
from cubestack.emulator.bus.line_format import LineFormat
from cubestack.emulator.faults.sites import Sites
from cubestack.emulator.iss.image import Image
from cubestack.emulator.iss.machine import FLASH_BASE, RAM_BASE, Machine
from cubestack.emulator.iss.outcome import Outgoing, OutgoingKind
from cubestack.emulator.sim.firmware_processor import FirmwareProcessor

HANG_US = 1
"""Any value: only its own watchdog can end a hanging program."""

BROWN_OUT, BROWN_OUT_REGULATED, RESET_PIN, WATCHDOG, LOCK_UP = (1 << bit for bit in range(1, 6))
"""Bits of RMU_RSTCAUSE: EFM32GG Reference Manual, section 9.3.2."""

FORCED_RESETS: Mapping[str, int] = {
    "brown-out": BROWN_OUT,
    "brown-out-regulated": BROWN_OUT_REGULATED,
    "reset-pin": RESET_PIN,
    "hang": WATCHDOG,
    "lock-up": LOCK_UP,
}
"""Causes of resets that the program did not request, the most common one first."""

Handlers = Mapping[OutgoingKind, Callable[[Outgoing], None]]


class OwnFirmwareBoard(Board):
    """A board whose processor runs an image.

    Attributes:
        machine: its processor: memories, registers, pins.
        image: the firmware.
        camera: the camera, for a debugger's view of its registers; None without one.
    """

    processor: FirmwareProcessor
    insight: Insight
    machine: Machine
    image: Image
    camera: Camera | None = None

    def _load(self, image: Image, external_bytes: int = 0) -> None:
        """Create the machine with scrambled RAM, and load ``image``."""
        self.image = image
        self.machine = Machine(external_bytes=external_bytes)
        self._scramble(self.machine.ram)
        self.machine.load(image)
        self.insight = Insight(self.machine)

    def _start(self, handlers: Handlers, baud: int, **more: Any) -> None:
        """Start the processor; ``more``: keywords of `FirmwareProcessor`."""
        self._wires: list[SerialWire] = []
        self.processor = FirmwareProcessor(
            self.kernel,
            self.machine,
            handlers={**handlers, OutgoingKind.UART: self._sent},
            causes={cause: cause for cause in FORCED_RESETS.values()},
            look_ahead_ps=LineFormat(baud).character_ps * 9 // 10,
            on_activity=lambda awake: self.power.set_state(
                "processor", "run" if awake else "sleep"
            ),
            **more,
        )
        self.processor.host.name = self.image.path.name if self.image.path else ""

    def _connect(self, wire: SerialWire, baud: int, **line: str) -> None:
        """Add a serial line on ``wire``; ``line``: further arguments of ``_serial_line``."""
        wire.connect(self._serial_line(baud, lambda: wire, **line))
        self._wires.append(wire)

    def _lead_out(self, route: SerialRoute, baud: int) -> None:
        """Add a line on ``route``. Raises ValueError if a line is at its pins, or has its name."""
        for line, wire in zip(self.lines, self._wires, strict=True):
            if line.name == route.block or {route.tx, route.rx} & {wire.tx, wire.rx}:
                raise ValueError(f"serial {route}: {line.name} is led out already; leave one out")
        wire = SerialWire(self.processor, route.tx, route.rx, follows=True)
        names = {"name": route.block, "title": str(route), "place": route.place}
        self._connect(wire, baud, suffix=f".{route.block}" if self.lines else "", **names)

    def _sent(self, one: Outgoing) -> None:
        for wire in self._wires:
            wire.sent(one)

    def busy(self) -> bool:
        return any(line.uart.busy for line in self.lines) or not self.processor.waiting

    def probes(self) -> dict[str, int | str]:
        return super().probes() | {"energy_mode": self.processor.energy_mode}

    def connect_console(self, report: Callable[[str], None]) -> None:
        self.processor.console = self.processor.on_fault = report

    def connect_program(
        self, on_exit: Callable[[int], None], read: Callable[[int], bytes | None]
    ) -> None:
        self.processor.on_exit, self.processor.host.read = on_exit, read

    def enable_semihosting(self, root: Path | None = None) -> None:
        """Answer semihosting calls; the program may use files in ``root``, if any."""
        self.machine.semihosting(True)
        self.processor.host.root = root

    def reset_pin(self) -> None:
        self.processor.reset(RESET_PIN)

    def close(self) -> None:
        super().close()
        self.processor.host.close()
        self.insight.close()
        self.machine.close()

    def sites(self) -> Sites:
        sites, machine = super().sites(), self.machine
        resets = {
            name: partial(self.processor.reset, cause, HANG_US if cause == WATCHDOG else 0)
            for name, cause in FORCED_RESETS.items()
        }
        return replace(
            sites,
            resets=resets,
            memories={**sites.memories, "ram": machine.ram, "flash": machine.flash},
            core=Core(self.processor),
            changed=self._memory_changed,
        )

    def _memory_changed(self, name: str, first: int, count: int) -> None:
        bases = {"ram": RAM_BASE, "flash": FLASH_BASE}
        if name in bases:
            self.machine.invalidate(bases[name] + first, count)

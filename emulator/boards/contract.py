"""What every board has: a processor with its program, supplies, serial lines and an I2C bus."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.boards.insight import Insight
from cubestack.emulator.bus.i2c import Forwarder, I2cBus, I2cTarget
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.faults.injector import Faults
from cubestack.emulator.faults.sites import Sites
from cubestack.emulator.i2cdev.direct import DirectI2c
from cubestack.emulator.ports.direct import DirectSerial
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.sim.microcontroller import Microcontroller
from cubestack.emulator.sim.power import PowerModel, PowerTable
from cubestack.emulator.sim.processor import Program
from cubestack.emulator.sim.virtual_time import Kernel

NODE_PROTOCOL = "node protocol"
"""Title of a serial line that has it."""

SILENCE_BYTES = 100
"""Byte times of silence after which a UART gives up half a message: assumed."""


class UartLink(Protocol):
    """What a program has behind a serial line."""

    def uart_byte(self, byte: int) -> None:
        """Interrupt: a byte was received."""

    def uart_silence(self) -> None:
        """Interrupt: the line has been silent for long."""


class NodeLink(UartLink, I2cTarget, Protocol):
    """What a program has behind both ways to the satellite."""


@dataclass(frozen=True)
class SerialLine:
    """A serial port of a device.

    Attributes:
        name: of the port, in recordings.
        title: what it speaks.
        suffix: behind the name of the first line's link.
        uart: the device's end.
    """

    name: str
    title: str
    suffix: str
    uart: Uart

    @property
    def baud(self) -> int:
        """Bits a second."""
        return self.uart.form.baud

    @property
    def has_node(self) -> bool:
        """Whether the node protocol is spoken on it."""
        return self.title == NODE_PROTOCOL

    @property
    def target(self) -> str:
        """Its name among the targets of faults."""
        return self.suffix.removeprefix(".") or self.name


class Board(ABC):
    """One emulated device, powered up.

    Several boards may share a kernel, and on it an I2C bus.

    Attributes:
        kernel: virtual time.
        i2c_bus: the satellite's I2C bus.
        seed: of everything random but the scene.
        power: supplies; the place for latch-ups.
        lines: serial lines, the satellite's first.
        on_close: what is to be done before the board is closed.
        engine: FPGAs and their SRAMs; None on a board without.
        insight: into firmware of the user's own; None where none runs.
        processor: microcontroller with the running program.
        program: firmware program that runs now; a reset makes a new one.
    """

    random_stream: ClassVar[tuple[int, ...]] = ()
    """What its random numbers are seeded with beside ``seed``."""

    firmware: str = ""
    """Own firmware that it runs, as its ``firmware`` option takes it, hash included."""

    engine: RtlEngine | None = None
    insight: Insight | None = None
    processor: Microcontroller
    program: Program

    def __init__(
        self, power: PowerTable, *, seed: int, kernel: Kernel | None, i2c_bus: I2cBus | None
    ) -> None:
        """Take a place in virtual time.

        Args:
            power: what draws current.
            seed: of everything random but the scene, 0 or more.
            kernel: virtual time, at its start; an own one unless given.
            i2c_bus: bus of that kernel to be attached to; an own one unless given.

        Raises:
            ValueError: the kernel is under way, or the bus is another kernel's.
        """
        self.kernel = kernel if kernel is not None else Kernel()
        if self.kernel.now:
            raise ValueError(f"a board is powered up at time 0, not at {self.kernel.now} ps")
        self.i2c_bus = i2c_bus if i2c_bus is not None else I2cBus(self.kernel)
        if self.i2c_bus.kernel is not self.kernel:
            raise ValueError("a board on a shared I2C bus needs the kernel of that bus")
        self.seed = seed
        self.power = PowerModel(self.kernel, power)
        self.lines: tuple[SerialLine, ...] = ()
        self.on_close: list[Callable[[], None]] = []
        self._rng = np.random.default_rng([seed, *self.random_stream])

    @property
    @abstractmethod
    def scene(self) -> object:
        """What the cameras see; a new one is seen by the next image that is rendered.

        Raises TypeError for a scene that they can not see.
        """

    @scene.setter
    @abstractmethod
    def scene(self, scene: object) -> None: ...

    @property
    def uart(self) -> Uart:
        """Device's end of the satellite's serial line."""
        return self.lines[0].uart

    @cached_property
    def faults(self) -> Faults:
        """Injects faults into this board."""
        return Faults(self.sites(), self.seed)

    def serial(self, name: str = "uart") -> DirectSerial:
        """Host's end of the serial line ``name``, in this process; KeyError for none."""
        return DirectSerial(self.kernel, self.uarts[name])

    def i2c(self) -> DirectI2c:
        """Host's end of the I2C bus, in this process."""
        return DirectI2c(self.kernel, self.i2c_bus)

    @property
    def uarts(self) -> dict[str, Uart]:
        """Device's ends of the serial lines, by their names in recordings."""
        return {line.name: line.uart for line in self.lines}

    def busy(self) -> bool:
        """Whether anything is under way that does not wait for the host."""
        return any(line.uart.busy for line in self.lines) or not self.processor.dozing

    def probes(self) -> dict[str, int | str]:
        """What a trace shows of the firmware, as it is now, by name."""
        return {"awake": int(not self.processor.dozing), "resets": self.processor.resets}

    def pictures(self) -> dict[str, NDArray[np.uint8]]:
        """What the memories with pictures hold, each (rows, columns), by memory; live views."""
        return {}

    def truths(self) -> dict[str, NDArray[np.float64]]:
        """What should be measured in what was stored last, by what it is of.

        An attitude is a quaternion (4,), a direction a pair of angles (alpha, beta) in degrees. For
        whoever compares results, never for the firmware.
        """
        return {}

    def tell(self, say: Callable[[str], None]) -> None:
        """Give ``say`` what own firmware prints by debug channels, and reports of its faults."""
        del say  # a modelled program has none

    def close(self) -> None:
        """Release what the board holds."""
        for act in self.on_close:
            act()
        if self.engine is not None:
            self.engine.close()

    def sites(self) -> Sites:
        """Where faults can hit: here what all boards have."""
        uarts, buses = {line.target: line.uart for line in self.lines}, {"i2c": self.i2c_bus}
        return Sites(self.kernel, self.processor, uarts, buses, self.power, self.engine)

    def _node_link(self, link: Callable[[], NodeLink], baud: int, i2c_address: int) -> None:
        """Lead the satellite's serial line and I2C bus to what ``link`` finds in the program."""
        self._serial_line(baud, link)
        self.i2c_bus.attach(i2c_address, Forwarder(lambda: [link()]))

    def _serial_line(
        self,
        baud: int,
        link: Callable[[], UartLink],
        name: str = "uart",
        title: str = NODE_PROTOCOL,
        suffix: str = "",
    ) -> Uart:
        """One more of ``lines``, which leads to what ``link`` finds in the program that runs."""
        deliver, silent = lambda byte: link().uart_byte(byte), lambda: link().uart_silence()
        uart = Uart(self.kernel, baud, deliver, silent, silence_bytes=SILENCE_BYTES)
        self.lines += (SerialLine(name, title, suffix, uart),)
        return uart

    def _scramble(self, memory: NDArray[np.uint8]) -> None:
        """What a static RAM holds after power-up."""
        memory[:] = np.frombuffer(self._rng.bytes(memory.size), np.uint8)

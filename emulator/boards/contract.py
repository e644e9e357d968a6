"""Base class of the boards: processor with program, supplies, serial lines and an I2C bus."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, Protocol, TypedDict

import numpy as np
from numpy.typing import NDArray

from cubestack.emulator.bus.i2c import Forwarder, I2cBus, I2cTarget
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.faults.sites import Sites
from cubestack.emulator.ports.line import DirectSerial
from cubestack.emulator.sim.fpga_port import Microcontroller
from cubestack.emulator.sim.power import PowerModel, PowerTable
from cubestack.emulator.sim.processor import Program
from cubestack.emulator.sim.virtual_time import Kernel

if TYPE_CHECKING:
    from cubestack.emulator.boards.firmware import Insight
    from cubestack.emulator.boards.pins import Pins
    from cubestack.emulator.faults.injector import Faults
    from cubestack.emulator.i2cdev.direct import DirectI2c
    from cubestack.emulator.rtl.contract import RtlEngine
    from cubestack.emulator.rtl.wiring import Wiring

NODE_PROTOCOL = "node protocol"

SILENCE_BYTES = 100
"""Byte times of silence after which a UART drops an incomplete message: assumed."""


class UartLink(Protocol):
    """A program's interrupt handlers of a serial line."""

    def uart_byte(self, byte: int) -> None: ...

    def uart_silence(self) -> None:
        """Called after ``SILENCE_BYTES`` byte times without a byte."""


class NodeLink(UartLink, I2cTarget, Protocol):
    """A program's interrupt handlers of the serial line and the I2C bus to the satellite."""

    def uart_block(self, data: bytes) -> None:
        """As ``uart_byte`` for each of ``data``; asked only where the link has a ``frame_end``."""


class BoardOptions(TypedDict, total=False):
    """Keyword arguments that all boards accept; see ``Board``."""

    seed: int
    kernel: Kernel | None
    i2c_bus: I2cBus | None
    gateware: str
    gateware_param: str


@dataclass(frozen=True)
class SerialLine:
    """A serial port of a device."""

    name: str  # name of the port in recordings
    title: str  # its protocol
    suffix: str  # appended to the pty path of the first line
    uart: Uart  # the device's end
    place: str = ""  # own path or TCP port; empty: beside the first line's

    @property
    def baud(self) -> int:
        return self.uart.form.baud

    @property
    def has_node(self) -> bool:
        return self.title == NODE_PROTOCOL

    @property
    def target(self) -> str:
        """Its name as a target of faults."""
        return self.suffix.removeprefix(".") or self.name


class Board(ABC):
    """One emulated device, powered up.

    Several boards may share a kernel and its I2C bus.

    Attributes:
        seed: seed of all random numbers except the scene's.
        rng: source of random numbers that follows from ``seed``.
        lines: serial lines, the satellite's first.
        on_close: functions that ``close`` calls first.
        engine: FPGAs and their SRAMs; None on a board without.
        insight: analysis of a user's own firmware; None without one.
        pins: port pins of the processor, where nothing else is connected to them; else None.
        program: the running firmware program; a reset creates a new one.
    """

    random_stream: ClassVar[tuple[int, ...]] = ()
    """Seed of its random numbers, in addition to ``seed``."""

    firmware: str = ""
    """Value of the option ``firmware``, with the hash, if the board runs a user's own firmware."""

    engine: "RtlEngine | None" = None
    insight: "Insight | None" = None
    pins: "Pins | None" = None
    processor: Microcontroller
    program: Program

    def __init__(
        self,
        power: PowerTable,
        *,
        seed: int = 0,
        kernel: Kernel | None = None,
        i2c_bus: I2cBus | None = None,
        gateware: str = "",
        gateware_param: str = "",
    ) -> None:
        """Power up.

        Args:
            power: the supplies.
            seed: seed of all random numbers except the scene's, 0 or more.
            kernel: virtual time, which must be 0; by default a new one.
            i2c_bus: the satellite's bus, on the same kernel; by default a new one.
            gateware: a user's design in place of the shipped one, see ``hdl.user``; empty for none.
            gateware_param: its parameters, "NAME=VALUE,...".

        Raises:
            ValueError: the kernel's time is not 0, or the bus has another kernel.
        """
        self._gateware = gateware, gateware_param
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
        self.rng = np.random.default_rng([seed, *self.random_stream])

    @property
    @abstractmethod
    def scene(self) -> object:
        """What the cameras see; a new scene takes effect with the next rendered image.

        Raises TypeError for a scene of the wrong type.
        """

    @scene.setter
    @abstractmethod
    def scene(self, scene: object) -> None: ...

    @property
    def uart(self) -> Uart:
        return self.lines[0].uart

    @cached_property
    def faults(self) -> "Faults":
        from cubestack.emulator.faults.injector import Faults

        return Faults(self.sites(), self.seed)

    def serial(self, name: str = "") -> DirectSerial:
        """A host's end of a serial line, by default the first; KeyError for an unknown name."""
        return DirectSerial(self.kernel, self.uarts[name] if name else self.uart)

    def i2c(self) -> "DirectI2c":
        """A host's end of the I2C bus in this process."""
        from cubestack.emulator.i2cdev.direct import DirectI2c

        return DirectI2c(self.kernel, self.i2c_bus)

    @property
    def uarts(self) -> dict[str, Uart]:
        """The device's ends of the serial lines, by their names in recordings."""
        return {line.name: line.uart for line in self.lines}

    def busy(self) -> bool:
        """Whether any activity is under way that does not wait for the host."""
        return any(line.uart.busy for line in self.lines) or not self.processor.dozing

    def probes(self) -> dict[str, int | str]:
        """Current values of the firmware for a trace, by name."""
        return {"awake": int(not self.processor.dozing), "resets": self.processor.resets}

    def pictures(self) -> dict[str, NDArray[np.uint8]]:
        """Images in the memories, each (rows, columns), by memory; live views."""
        return {}

    def truths(self) -> dict[str, NDArray[np.float64]]:
        """True values for the latest stored image, by quantity; for tests and reports only.

        An attitude is a quaternion (4,), a direction a pair of angles (alpha, beta) in degrees.
        """
        return {}

    def connect_console(self, report: Callable[[str], None]) -> None:
        """Send text on the firmware's debug channels, and reports of its faults, to ``report``."""
        del report  # a modelled program prints nothing

    def connect_program(
        self, on_exit: Callable[[int], None], read: Callable[[int], bytes | None]
    ) -> None:
        """Connect a program that uses semihosting.

        Args:
            on_exit: receives the status with which it ends.
            read: the console's input, see ``SemihostingHost``.
        """
        del on_exit, read  # a modelled program has no host

    def close(self) -> None:
        """Call ``on_close``, and release the engine."""
        for act in self.on_close:
            act()
        if self.engine is not None:
            self.engine.close()

    def sites(self) -> Sites:
        """Places where faults can be injected; here those of all boards."""
        uarts, buses = {line.target: line.uart for line in self.lines}, {"i2c": self.i2c_bus}
        return Sites(self.kernel, self.processor, uarts, buses, self.power, self.engine)

    def _fitted(self, wiring: "Wiring") -> "Wiring":
        """``wiring`` with the design that the user has chosen, if any; see ``with_gateware``."""
        if not any(self._gateware):
            return wiring
        from cubestack.emulator.boards.gateware import with_gateware

        return with_gateware(wiring, *self._gateware)

    def _node_link(self, link: Callable[[], NodeLink], baud: int, i2c_address: int) -> None:
        """Connect the satellite's serial line and I2C bus to the handlers from ``link``."""
        line = self._serial_line(baud, link)
        line.frame_end = lambda: getattr(link(), "frame_end", None)
        line.on_block = lambda data: link().uart_block(data)
        line.heeds_silence = lambda: getattr(link(), "receiving", True)
        self.i2c_bus.attach(i2c_address, Forwarder(lambda: [link()]))

    def _serial_line(
        self,
        baud: int,
        link: Callable[[], UartLink],
        name: str = "uart",
        title: str = NODE_PROTOCOL,
        suffix: str = "",
        place: str = "",
    ) -> Uart:
        """Add a serial line, connected to the handlers that ``link`` returns at each interrupt."""
        deliver, silent = lambda byte: link().uart_byte(byte), lambda: link().uart_silence()
        uart = Uart(self.kernel, baud, deliver, silent, silence_bytes=SILENCE_BYTES)
        self.lines += (SerialLine(name, title, suffix, uart, place),)
        return uart

    def _scramble(self, memory: NDArray[np.uint8]) -> None:
        memory[:] = np.frombuffer(self.rng.bytes(memory.size), np.uint8)

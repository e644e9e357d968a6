"""A machine: core, part and memories in C++, through ctypes. Times are integer picoseconds.

A run ends at the requested time, or earlier when the outbox has messages. Inputs are set between
two runs. A running machine never calls Python, except for an FPGA without a compiled driver.
"""

import ctypes
import math
from collections.abc import Iterator, MutableSet

import numpy as np

from cubestack.emulator.iss.binding import (
    FlashChangeRecord,
    FpgaDriverRecord,
    FpgaWireRecord,
    Library,
    OutgoingRecord,
    simulator,
)
from cubestack.emulator.iss.flash_changes import (
    INFORMATION_BASE,
    PAGE_BYTES,
    PAGE_STEP,
    FlashChange,
)
from cubestack.emulator.iss.image import Image
from cubestack.emulator.iss.outcome import Outgoing, OutgoingKind, Stop, StopReason, Watch, WatchHit

FLASH_BASE = 0x0000_0000
RAM_BASE = 0x2000_0000
EXTERNAL_BASE = 0x8000_0000
"""First bank of the external bus; code cannot run there."""

FLASH_BYTES = 1 << 20
RAM_BYTES = 128 << 10
INFORMATION_BYTES = 3 * PAGE_BYTES
"""User page, lock bits, device information."""

LOADED_PAGES = 2
"""Of them, those that a program's file may fill."""

ANALOG_INPUTS = 32
"""Number of channels; ``analog::Input`` in efm32gg/part/part.h lists them."""

NEVER = (1 << 63) - 1
"""The latest time that can be represented."""

_SPECIAL = ("xpsr", "msp", "psp", "primask", "basepri", "faultmask", "control")

REGISTERS = (*(f"r{n}" for n in range(13)), "sp", "lr", "pc", *_SPECIAL)
"""Names of the core's registers, in the order of their numbers."""

_NUMBERS = {name: number for number, name in enumerate(REGISTERS)} | {
    f"r{n}": n for n in range(16)
}  # fmt: skip

_REASONS = tuple(StopReason)


class Machine:
    """One microcontroller.

    Attributes:
        flash, ram, external: its memories, shared; call ``invalidate`` after changing code.
        analog: volts at each analog input, shared; call ``analog_changed`` after a change.
        image: the program loaded last.
        breakpoints: addresses; a run stops before the instruction there.
    """

    def __init__(
        self,
        *,
        flash_bytes: int = FLASH_BYTES,
        ram_bytes: int = RAM_BYTES,
        external_bytes: int = 0,
        bare_hz: int | None = None,
        library: Library | None = None,
    ) -> None:
        """Create a machine in reset; sizes are powers of two.

        ``bare_hz``: without a part, only memories and a core at that clock.

        Raises:
            CompilerError: the library is missing and cannot be built.
        """
        self._library = library if library is not None else simulator()
        self.flash = np.full(flash_bytes, 0xFF, np.uint8)
        self.ram = np.zeros(ram_bytes, np.uint8)
        self.external = np.zeros(external_bytes, np.uint8)
        self.information = np.full(INFORMATION_BYTES, 0xFF, np.uint8)
        self.analog = np.zeros(ANALOG_INPUTS, np.float64)
        self.image: Image | None = None
        self._outgoing = (OutgoingRecord * 256)()
        self._reached = ctypes.c_int64()
        self._handle: int | None = self._library.iss_new(
            *(item for memory in (self.flash, self.ram, self.external)
              for item in (memory.ctypes.data, memory.size)),
            self.information.ctypes.data,
            self.analog.ctypes.data,
            bare_hz is not None,
            bare_hz or 0,
        )  # fmt: skip
        self.breakpoints: MutableSet[int] = Breakpoints(self)
        self._watches: set[Watch] = set()

    def close(self) -> None:
        if self._handle is not None:
            self._library.iss_delete(self._handle)
            self._handle = None

    def __del__(self) -> None:
        if getattr(self, "_handle", None) is not None:
            self.close()

    @property
    def handle(self) -> int:
        """Pointer to the C++ machine; RuntimeError once it is closed."""
        if self._handle is None:
            raise RuntimeError("the machine is closed; create a new one")
        return self._handle

    # Programs and running

    def load(self, image: Image) -> None:
        """Erase flash, user page and lock bits and write a program to them; ``reset`` starts it."""
        self.flash[:] = 0xFF
        self.information[: LOADED_PAGES * PAGE_BYTES] = 0xFF
        for address, data in image.segments:
            memory, start = self.flash, address - FLASH_BASE
            if address >= INFORMATION_BASE:
                page, start = divmod(address - INFORMATION_BASE, PAGE_STEP)
                memory = self.information[page * PAGE_BYTES :]
            memory[start : start + len(data)] = np.frombuffer(data, np.uint8)
        self.image = image
        self.invalidate(FLASH_BASE, self.flash.size)

    def reset(self, cause: int = 1) -> None:
        """Reset now; ``cause``: bits of RMU_RSTCAUSE, 1 is power-on."""
        self._library.iss_reset(self.handle, cause)

    def run(self, until_ps: int) -> Stop:
        """Run up to a time, or to a message that requires a stop.

        After about half a million instructions it returns early, with the reason TIME, so that the
        caller can handle an interrupt; call it again. An asleep machine advances to its next event,
        or to ``until_ps``.
        """
        return self._stop(self._library.iss_run(self.handle, until_ps, self._reached))

    def step(self, until_ps: int = NEVER, within: tuple[int, int] = (0, 0)) -> Stop:
        """Execute one instruction, or more while the next one is ``within`` [low, high)."""
        return self._stop(self._library.iss_step(self.handle, until_ps, *within, self._reached))

    def _stop(self, answer: int) -> Stop:
        return Stop(_REASONS[answer & 0xFF], self._reached.value, answer > 0xFF)

    def hang(self) -> None:
        """Stop the core until a reset; time passes."""
        self._library.iss_hang(self.handle)

    def stop(self) -> None:
        """End the run after the current instruction; for callbacks during a run."""
        self._library.iss_stop(self.handle)

    @property
    def now_ps(self) -> int:
        return int(self._library.iss_now(self.handle))

    @property
    def cycles(self) -> int:
        """Core cycles since creation."""
        return int(self._library.iss_cycles(self.handle))

    @property
    def instructions(self) -> int:
        """Instructions executed since creation."""
        return int(self._library.iss_instructions(self.handle))

    @property
    def hz(self) -> int:
        return int(self._library.iss_hz(self.handle))

    @property
    def next_event_ps(self) -> int:
        """Time of the next event of a sleeping machine; ``NEVER`` if there is none."""
        return int(self._library.iss_next_event(self.handle))

    @property
    def energy_mode(self) -> int:
        """0 to 4."""
        return max(0, int(self._library.iss_asleep(self.handle)) - 1)

    @property
    def asleep(self) -> bool:
        return bool(self._library.iss_asleep(self.handle))

    def outbox(self) -> Iterator[Outgoing]:
        """Remove and yield the messages, in the order of time."""
        while count := self._library.iss_take(self.handle, self._outgoing, len(self._outgoing)):
            for one in self._outgoing[:count]:
                text = one.text.decode("utf-8", "replace")
                yield Outgoing(
                    OutgoingKind(one.kind), one.unit, one.value, one.extra, one.time_ps, text
                )

    # Registers and memory

    def register(self, name: str) -> int:
        """A core register by its name in ``REGISTERS``; KeyError for others."""
        return int(self._library.iss_register(self.handle, _NUMBERS[name]))

    def set_register(self, name: str, value: int) -> None:
        """Set a core register by its name in ``REGISTERS``."""
        self._library.iss_set_register(self.handle, _NUMBERS[name], value & 0xFFFF_FFFF)

    def registers(self) -> dict[str, int]:
        return {name: self.register(name) for name in REGISTERS}

    def peek(self, address: int, count: int) -> bytes:
        """Read memory without side effects; returns fewer bytes at the end of a memory."""
        buffer = (ctypes.c_uint8 * count)()
        done = self._library.iss_peek(self.handle, address, buffer, count)
        return bytes(buffer[:done])

    def poke(self, address: int, data: bytes) -> int:
        """Write memory as a debugger, flash too; returns the number of bytes written."""
        buffer = (ctypes.c_uint8 * len(data)).from_buffer_copy(data)
        return int(self._library.iss_poke(self.handle, address, buffer, len(data)))

    def read(self, address: int, size: int = 4) -> int | None:
        """Bus access with side effects; None for a bus fault."""
        value = ctypes.c_uint32()
        if not self._library.iss_load(self.handle, address, size, value):
            return None
        return value.value

    def write(self, address: int, value: int, size: int = 4) -> bool:
        """Bus access with side effects; False for a bus fault."""
        return bool(self._library.iss_store(self.handle, address, size, value))

    def invalidate(self, address: int, count: int) -> None:
        """Discard decoded instructions of memory that was changed from outside."""
        self._library.iss_invalidate(self.handle, address, count)

    # Flash

    def log_flash(self, on: bool = True) -> None:
        """Log the changes of flash, user page and lock bits that the program makes."""
        self._library.iss_flash_log(self.handle, on)

    def flash_changes(self) -> list[FlashChange]:
        """Remove and return the logged changes, in the order of time."""
        found, records = list[FlashChange](), (FlashChangeRecord * 256)()
        while count := self._library.iss_flash_changes(self.handle, records, len(records)):
            found += [FlashChange.of(one) for one in records[:count]]
        return found

    def wear_out(self, address: int, mask: int) -> None:
        """Let the bits in ``mask`` of a word in flash keep their value for good."""
        self._library.iss_flash_wear(self.handle, address, mask)

    # Inputs

    def pin(self, port: int, bit: int, level: int) -> None:
        """Drive a port pin from outside; level -1 releases it."""
        self._library.iss_pin(self.handle, port, bit, level)

    def pin_level(self, port: int, bit: int) -> int:
        return int(self._library.iss_pin_level(self.handle, port, bit))

    def pin_millivolts(self, port: int, bit: int) -> float | None:
        """Voltage that the DAC drives at a port pin; None if it does not."""
        volts = float(self._library.iss_pin_volts(self.handle, port, bit))
        return None if math.isnan(volts) else 1000 * volts

    def uart_receive(self, unit: int, data: int, flags: int = 0) -> None:
        """Deliver a complete character to a serial block.

        ``unit``: index of ``SERIAL_UNITS``, or 0x100 | RX pin (16 * port + bit) for the blocks that
        receive at this pin. ``flags``: 1 framing error, 2 parity error; from bit 8 the line's bits
        per second. A sent character is a message ``UART`` whose unit is block | TX pin << 8.
        """
        self._library.iss_uart_receive(self.handle, unit, data, flags)

    def i2c_slave_start(self, unit: int, address_byte: int) -> int | None:
        """Send a (repeated) start with that address byte.

        Returns 1 if acknowledged, else 0; None while the clock is stretched: run on and call
        ``i2c_slave_poll``.
        """
        return self._slave(unit, 0, address_byte)

    def i2c_slave_write(self, unit: int, byte: int) -> int | None:
        """Write a byte to the slave; returns as ``i2c_slave_start``."""
        return self._slave(unit, 1, byte)

    def i2c_slave_read(self, unit: int, acknowledged: bool = True) -> int | None:
        """Read a byte; None as above. ``acknowledged``: whether the previous byte was."""
        return self._slave(unit, 2, int(acknowledged))

    def i2c_slave_stop(self, unit: int) -> None:
        self._slave(unit, 3, 0)

    def i2c_slave_poll(self, unit: int) -> int | None:
        """Answer to the latest call that returned None."""
        return self._slave(unit, 4, 0)

    def i2c_answer(self, unit: int, acknowledged: bool, data: int = 0) -> None:
        """Answer a start, byte or read message of the master."""
        self._library.iss_i2c_answer(self.handle, unit, acknowledged, data)

    def analog_changed(self) -> None:
        """Re-evaluate the comparators after a change of ``analog``."""
        self._library.iss_analog_changed(self.handle)

    # The FPGA at its pins

    def couple(self, driver: FpgaDriverRecord, wires: ctypes.Array[FpgaWireRecord]) -> None:
        """Connect port pins to an FPGA; see fpga_link.h."""
        self._coupled = driver, wires  # keeps the callbacks alive
        self._library.iss_fpga(self.handle, driver, wires, len(wires))

    def fpga_running(self, running: int) -> None:
        """Set the running cameras of the FPGA, one bit each."""
        self._library.iss_fpga_running(self.handle, running)

    # Debugging

    @property
    def watchpoints(self) -> frozenset[Watch]:
        return frozenset(self._watches)

    def watch(self, watch: Watch, on: bool = True) -> None:
        kind = {"r": 1, "w": 2, "a": 3}[watch.kind]
        if on != (watch in self._watches):
            self._library.iss_watchpoint(self.handle, watch.address, watch.length, kind, on)
            (self._watches.add if on else self._watches.discard)(watch)

    @property
    def watch_hit(self) -> WatchHit:
        """The access at which the last run stopped."""
        found = (ctypes.c_uint32 * 5)()
        self._library.iss_watch_hit(self.handle, found)
        return WatchHit(found[0], found[1], found[2], found[3], bool(found[4]))

    def attach_debugger(self, attached: bool, catches: int = 0) -> None:
        """With a debugger, BKPT and the exceptions in ``catches`` (DEMCR.VC_*) stop a run."""
        self._library.iss_debugger(self.handle, attached, catches)

    def semihosting(self, on: bool) -> None:
        """Whether BKPT 0xAB is a call of the host, a message ``SEMIHOSTING``, not a fault."""
        self._library.iss_semihosting(self.handle, on)

    def answer_call(self, result: int) -> None:
        """Answer a semihosting call; until then nothing runs and no time passes."""
        self._library.iss_semihosting_answer(self.handle, result & 0xFFFF_FFFF)

    def _slave(self, unit: int, what: int, byte: int) -> int | None:
        answer = int(self._library.iss_i2c_slave(self.handle, unit, what, byte))
        return None if answer < 0 else answer


class Breakpoints(MutableSet[int]):
    """Addresses at which a machine stops before executing."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._addresses: set[int] = set()

    def __contains__(self, address: object) -> bool:
        return address in self._addresses

    def __iter__(self) -> Iterator[int]:
        return iter(sorted(self._addresses))

    def __len__(self) -> int:
        return len(self._addresses)

    def add(self, value: int) -> None:
        self._set(value & ~1, True)

    def discard(self, value: int) -> None:
        self._set(value & ~1, False)

    def _set(self, address: int, on: bool) -> None:
        if on != (address in self._addresses):
            library = self._machine._library
            library.iss_breakpoint(self._machine.handle, address, on)
            (self._addresses.add if on else self._addresses.discard)(address)

"""Targets that host tools talk to, by a text: what it names, and how it is opened.

==========================  ===================================================================
/dev/ttyUSB0, ./ttyCUBE     a serial port
tcp://HOST:PORT             a serial line on TCP
rfc2217://HOST:PORT         a serial port on TCP whose rate the client sets
i2c:BUS[:ADDR]              /dev/i2c-BUS, or the emulated bus where there is no such file; 7-bit
                            address of the node (default: the device's)
recorded:FILE               a recording, which answers like the device did
==========================  ===================================================================

``emulated:DEVICE`` is opened by ``host.cli.targets``, as it needs the emulator.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from smbus2 import SMBus

from cubestack.firmware_model.formats.recording import load_recording
from cubestack.firmware_model.interface.aramis import INTERFACE as ARAMIS
from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.firmware_model.interface.cubesense import INTERFACE as CUBESENSE
from cubestack.firmware_model.interface.cubestar import INTERFACE as CUBESTAR
from cubestack.host.clients.contract import Client
from cubestack.host.clients.i2c import I2cBus, I2cClient
from cubestack.host.clients.node import NodeClient
from cubestack.host.clients.registers import RegisterClient
from cubestack.host.errors import PortOpenError, TargetError
from cubestack.host.recording.host_recorder import HostRecorder
from cubestack.host.recording.playback import RecordedI2c, RecordedTransport
from cubestack.host.transport.streams import Transport, open_transport

__all__ = ["INTERFACES", "Controls", "Target", "interface_of", "open_target", "with_i2c"]

#: Interface of each device, by the name that the command line uses.
INTERFACES = {interface.name.lower(): interface for interface in (CUBESTAR, CUBESENSE, ARAMIS)}

I2C, RECORDED = "i2c:", "recorded:"


class Controls(Protocol):
    """What can be done to an emulated device from outside of its ports."""

    faults: tuple[str, ...]
    """What ``fault`` takes, as a user types it."""

    fault_parameters: Mapping[str, tuple[str, ...]]
    """What may follow each kind of fault and its target, as NAME=VALUE."""

    channels: tuple[str, ...]
    """Load switches."""

    def fault(self, words: list[str]) -> None:
        """Let something break; ValueError for what is not in ``faults``."""

    def fault_log(self) -> list[str]:
        """A line for each thing that faults have done, with its virtual time."""

    def scene(self, path: Path) -> None:
        """Show another scene; ValueError for a file that is none."""

    def currents(self) -> dict[str, float]:
        """Supply currents in mA: all, and each channel's."""

    def switch(self, channel: str, on: bool) -> None:
        """Switch a channel; ValueError for an unknown one."""

    def time_s(self) -> float:
        """Virtual time."""

    def advance(self, seconds: float) -> None:
        """Let virtual time pass."""


@dataclass
class Target:
    """An open target.

    Attributes:
        name: as the user wrote it.
        interface: the device's.
        node: client of the node protocol.
        line: the serial line under it; None on I2C.
        registers: client of the register-pointer protocol; None where it is not within reach.
        bench: serial line with the bench protocol; None where it is not within reach.
        controls: None for a device that is not emulated here.
    """

    name: str
    interface: Interface
    node: Client
    line: Transport | None = None
    registers: RegisterClient | None = None
    bench: Transport | None = None
    controls: Controls | None = None
    on_close: list[Callable[[], None]] = field(default_factory=list)

    def close(self) -> None:
        """Release everything."""
        for callback in reversed(self.on_close):
            callback()


def interface_of(device: str | None, target: str) -> Interface:
    """The interface of ``device``; TargetError when it is not given or unknown."""
    known = ", ".join(INTERFACES)
    if device is None:
        raise TargetError(f"{target} does not tell which device it is: give --device ({known})")
    if device.lower() not in INTERFACES:
        raise TargetError(f"no device {device!r}; known: {known}")
    return INTERFACES[device.lower()]


def open_target(
    text: str,
    device: str | None = None,
    *,
    bench: str | None = None,
    baud: int | None = None,
    tape: HostRecorder | None = None,
) -> Target:
    """Open the target that ``text`` names.

    Args:
        text: see the module's text.
        device: name of the device; not needed for recordings and default I2C addresses.
        bench: another serial line, with the bench protocol.
        baud: of the node protocol's line; None for the published one.
        tape: records what is said; not for recordings.

    Raises:
        TargetError: the text names nothing, or the device is not told.
        TransportError: it does not open.
        RecordingError: a file is no recording.
    """
    if text.startswith(RECORDED):
        return _open_recorded(text)
    if text.startswith(I2C):
        target = _open_i2c(text, device, tape)
        bauds: dict[str, int] = {}
    else:
        interface = interface_of(device, text)
        baud = baud or interface.baud
        line = open_transport(text, baud)
        if tape is not None:
            line = tape.line(line, "uart", baud)
        target = Target(text, interface, NodeClient(line, interface), line)
        target.on_close.append(line.close)
        bauds = {"uart": baud}
    if bench is not None:
        bauds["bench_uart"] = _open_bench(target, bench, tape)
    if tape is not None:
        tape.begin(target.interface.name.lower(), bauds)
    return target


def _open_bench(target: Target, text: str, tape: HostRecorder | None) -> int:
    """Open the line with the bench protocol; returns its baud rate."""
    if target.interface.bench is None:
        target.close()
        raise TargetError(f"{target.interface.name} has no bench protocol: leave out --bench")
    baud = target.interface.bench.baud
    line = open_transport(text, baud)
    target.bench = line if tape is None else tape.line(line, "bench_uart", baud)
    target.on_close.append(line.close)
    return baud


def with_i2c(
    target: Target, bus: I2cBus, wait: Callable[[float], None] = time.sleep
) -> RegisterClient | None:
    """Client of the registers of ``target``'s device on ``bus``; None where it has none."""
    registers = target.interface.registers
    return None if registers is None else RegisterClient(bus, registers, wait=wait)


def _open_i2c(text: str, device: str | None, tape: HostRecorder | None) -> Target:
    bus_text, _, address_text = text.removeprefix(I2C).partition(":")
    try:
        number = int(bus_text)
        address = int(address_text, 0) if address_text else None
    except ValueError:
        number, address = -1, None
    if number < 0 or (address is not None and not 0x08 <= address <= 0x77):
        raise TargetError(f"{text}: must be i2c:BUS:ADDR, as in i2c:7:0x1a (0x08 to 0x77)")
    if device is None:
        found = [name for name, known in INTERFACES.items() if address in _addresses(known)]
        device = found[0] if found else None
    interface = interface_of(device, text)
    opened = _open_bus(number)
    bus: I2cBus = opened if tape is None else tape.bus(opened)
    own = None if address in _addresses(interface)[1:] else address
    target = Target(text, interface, I2cClient(bus, interface, own))
    target.registers = with_i2c(target, bus)
    target.on_close.append(opened.close)
    return target


def _open_bus(number: int) -> "SMBus":
    """The device file of bus ``number``; where there is none, the emulated bus of that number."""
    from smbus2 import SMBus

    try:
        return SMBus(number)
    except FileNotFoundError as error:
        from cubestack.host.transport.smbus import CubeSMBus

        try:
            return CubeSMBus(number)
        except PortOpenError as emulated:
            reason = f"can not open /dev/i2c-{number}: {error.strerror}; {emulated}"
            raise PortOpenError(reason) from error
    except OSError as error:
        raise PortOpenError(f"can not open /dev/i2c-{number}: {error.strerror}") from error


def _addresses(interface: Interface) -> list[int]:
    """The node's default address, then the registers', if any."""
    registers = [] if interface.registers is None else [interface.registers.i2c_address]
    return [interface.i2c_address, *registers]


def _open_recorded(text: str) -> Target:
    path = Path(text.removeprefix(RECORDED))
    try:
        recording = load_recording(path)
    except OSError as error:
        raise PortOpenError(f"can not open {path}: {error.strerror}") from error
    interface = interface_of(recording.device, text)
    bus = RecordedI2c(recording, interface)
    spoken = [port for port in recording.bauds if recording.sent(port, "host")[0]]
    if "uart" in spoken or (not recording.transfers and "uart" in recording.bauds):
        line = RecordedTransport(recording, interface)
        target = Target(text, interface, NodeClient(line, interface), line)
    else:
        client = I2cClient(bus, interface, wait=_no_wait)
        target = Target(text, interface, client)
    target.registers = with_i2c(target, bus, _no_wait)
    if "bench_uart" in recording.bauds:
        target.bench = RecordedTransport(recording, interface, "bench_uart")
    return target


def _no_wait(_seconds: float) -> None:
    """A recording has all the time in the world."""

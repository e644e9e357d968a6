"""Targets of host tools: the text that names one, and how to open it.

==========================  ===================================================================
/dev/ttyUSB0, ./ttyCUBE     a serial port
tcp://HOST:PORT             a serial line on TCP
rfc2217://HOST:PORT         a serial port on TCP whose rate the client sets
i2c:BUS[:ADDR]              /dev/i2c-BUS, or the emulated bus if that file does not exist; 7-bit
                            address of the node (default: the device's)
recorded:FILE               a recording, which answers as the device did
emulated:DEVICE             a device emulated in this process; time passes while the host waits
==========================  ===================================================================
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cubestack.firmware_model.formats.recording import load_recording
from cubestack.firmware_model.interface.codec.field import InterfaceError
from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.firmware_model.interface.codec.node_messages import IDENTIFICATION
from cubestack.firmware_model.versions import interface_of
from cubestack.host.clients.contract import Client
from cubestack.host.clients.diagnosis import identity_on, node_type_of
from cubestack.host.clients.i2c import I2cBus, I2cClient
from cubestack.host.clients.node import NodeClient
from cubestack.host.clients.registers import RegisterClient, RegisterLine
from cubestack.host.devices.device import AnyDevice, Engine
from cubestack.host.devices.registry import device, device_names, devices
from cubestack.host.emulation.controls import Controls, EmulatedControls
from cubestack.host.emulation.emulated import node_client, open_device
from cubestack.host.emulation.records import create_record, start_recorder
from cubestack.host.emulation.remote_controls import controlled
from cubestack.host.errors import NodeError, PortOpenError, TargetError
from cubestack.host.output import Outputs
from cubestack.host.recording.host_recorder import HostRecorder
from cubestack.host.recording.playback import RecordedI2c, RecordedTransport
from cubestack.host.recording.setups import emulated_setup, taped_setup
from cubestack.host.transport.streams import Transport, open_transport

if TYPE_CHECKING:
    from smbus2 import SMBus

I2C, RECORDED, EMULATED = "i2c:", "recorded:", "emulated:"

FORMS = (
    "a serial port, tcp://HOST:PORT, rfc2217://HOST:PORT, i2c:BUS:ADDR, emulated:DEVICE, "
    "recorded:FILE"
)
"""The forms of a target, for the help."""


@dataclass
class Target:
    """An open target."""

    name: str  #: as the user wrote it
    interface: Interface  #: of its messages
    node: Client  #: client of the node protocol
    line: Transport | None = None  #: the serial line under it; None on I2C
    registers: RegisterClient | None = None  #: client of the register-pointer protocol, or None
    service_port: Transport | None = None  #: serial line with the one-letter protocol, or None
    controls: Controls | None = None  #: None for a device that is not emulated here
    device: AnyDevice | None = None  #: its declaration; None for an unregistered interface
    recorded: Path | None = None  #: file with the session so far, or None
    on_close: list[Callable[[], None]] = field(default_factory=list)
    outputs: Outputs = field(default_factory=Outputs)  #: the recording

    def __enter__(self) -> Target:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Close it; if the call was wrong, an earlier recording that is not replaced yet stays."""
        if kind is not None and issubclass(kind, ValueError):
            self.outputs.drop()
        self.close()

    def close(self) -> None:
        for callback in reversed(self.on_close):
            callback()


def device_of(name: str | None, target: str) -> AnyDevice:
    """The device called ``name``; raises TargetError if it is None or unknown."""
    if name is None:
        known = ", ".join(device_names())
        raise TargetError(f"{target} does not name the device: add --device ({known})")
    return device(name)


def open_target(
    text: str,
    device: str | None = None,
    *,
    service_port: str | None = None,
    backup: bool = False,
    baud: int | None = None,
    scene: Path | None = None,
    seed: int = 0,
    engine: Engine = "auto",
    record: Path | None = None,
    control: str | None = None,
    options: Mapping[str, Any] | None = None,
    keep: bool = True,
) -> Target:
    """Open the target that ``text`` names.

    Args:
        text: one of the forms in the module's text.
        device: name of the device; not needed for emulated devices, recordings and default I2C
            addresses.
        service_port: another serial line, with the one-letter protocol.
        backup: the serial line speaks the register protocol in place of the node protocol.
        baud: of the serial line; None for the published one.
        scene: scene file of an emulated device; None for its default.
        seed: of an emulated device.
        engine: that runs an emulated device's FPGA.
        record: file for a recording of the session; an emulated device is recorded at its pins.
        control: control port of the process that emulates the device.
        options: of an emulated device's board, its profile among them.
        keep: give the recording its name at once; if not, `Target.outputs` keeps it, or drops it.

    Raises:
        TargetError: the text names no target, or not the device.
        TransportError: it does not open.
        RecordingError: the file is not a recording.
        ValueError: an invalid scene file, or a file that cannot be written.
    """
    if backup and text.startswith((EMULATED, RECORDED, I2C)):
        raise TargetError(f"--backup is for a serial line, not for {text}")
    if control is not None and text.startswith((EMULATED, RECORDED)):
        raise TargetError(
            f"--control is for a device that another process emulates, not for {text}"
        )
    if text.startswith(EMULATED):
        if service_port is not None:
            raise TargetError(f"{text} has its bench protocol already: leave out --bench")
        return _open_emulated(text, baud, scene, seed, engine, record, options or {}, keep)
    given = {"scene": scene is not None, "engine": engine != "auto"}
    for name in (*(name for name, here in given.items() if here), *(options or {})):
        raise TargetError(f"--{name} is for emulated:DEVICE, not for {text}")
    with Outputs() as stack:
        tape = None
        if record is not None:
            tape = HostRecorder(create_record(record, stack), taped_setup(text))
            stack.callback(tape.close)
        if text.startswith(RECORDED):
            target = _open_recorded(text)
        else:
            controls = None if control is None else controlled(control, device)
            owner = device if controls is None else controls.device
            target = _open_real(text, owner, service_port, backup, baud, tape)
            target.controls, target.recorded = controls, record
        if keep:
            stack.keep()
        target.outputs = stack
        target.on_close.insert(0, stack.pop_all().close)
        return target


def _open_emulated(
    text: str,
    baud: int | None,
    scene: Path | None,
    seed: int,
    engine: Engine,
    record: Path | None,
    options: Mapping[str, Any],
    keep: bool,
) -> Target:
    name = text.removeprefix(EMULATED).lower()
    if name not in device_names():
        known = ", ".join(EMULATED + one for one in device_names())
        raise TargetError(f"no device {name!r} can be emulated; known: {known}")
    emulated = open_device(name, scene, seed=seed, baud=baud, engine=engine, **options)
    board, interface = emulated.board, emulated.device.interface
    with Outputs() as stack:
        stack.callback(emulated.close)
        controls = EmulatedControls(emulated)
        if record is not None:
            setup = emulated_setup(seed, scene, options=options)
            recorder = start_recorder(emulated, create_record(record, stack), setup)
            stack.callback(recorder.close)
            if keep:
                stack.keep()
        lines = [board.serial(line.name) for line in board.lines]
        bus = board.i2c()
        has_node = board.lines[0].has_node
        return Target(
            text,
            interface,
            NodeClient(lines[0], interface) if has_node else node_client(board, interface),
            lines[0],
            registers=_registers(interface, bus if has_node else RegisterLine(lines[0]), bus.wait),
            service_port=lines[1] if interface.service_port and len(lines) > 1 else None,
            controls=controls,
            device=emulated.device,
            on_close=[stack.pop_all().close],
            outputs=stack,
        )


def _open_real(
    text: str,
    name: str | None,
    service_port: str | None,
    backup: bool,
    baud: int | None,
    tape: HostRecorder | None,
) -> Target:
    """Open a device on a serial line or an I2C bus."""
    if text.startswith(I2C):
        target = _open_i2c(text, name, tape)
        bauds: dict[str, int] = {}
    else:
        found = device_of(name, text)
        registers = found.interface.registers if backup else None
        if backup and (registers is None or registers.baud is None):
            raise TargetError(f"{found.title} has no registers on a UART: leave out --backup")
        baud = baud or (registers and registers.baud) or found.interface.baud
        line = open_transport(text, baud)
        if registers is None:
            _check_identity(text, found, lambda: identity_on(line), line.close)
        taped = line if tape is None else tape.line(line, "uart", baud)
        node = NodeClient(taped, found.interface)
        target = Target(text, found.interface, node, taped, device=found, on_close=[taped.close])
        if registers is not None:
            target.registers = RegisterClient(RegisterLine(taped), registers)
        bauds = {"uart": baud}
    if service_port is not None:
        bauds["bench_uart"] = _open_service_port(target, service_port, tape)
    if tape is not None:
        tape.begin(target.interface.name.lower(), bauds)
    return target


def _check_identity(
    text: str,
    wanted: AnyDevice,
    identity: Callable[[], tuple[int, int] | None],
    close: Callable[[], None],
) -> None:
    """Raise TargetError, and close the port, if the node is another registered device.

    Warns of firmware with another version of the interface: an operator may have no other tool.
    """
    with ExitStack() as stack:
        stack.callback(close)
        found, version = identity() or (None, None)
        known = {node_type_of(one.interface): one for one in devices()}
        if found is not None and found != node_type_of(wanted.interface) and found in known:
            other = known[found]
            raise TargetError(
                f"{text}: node type {found} is {_a(other.title)}, not {_a(wanted.title)}; "
                f"choose device {other.name}"
            )
        stack.pop_all()
    if found == node_type_of(wanted.interface):
        try:
            interface_of(wanted.title, wanted.interface.version).check(version)
        except ValueError as error:
            warnings.warn(f"{text}: {error}; values may be wrong", stacklevel=3)


def _a(title: str) -> str:
    return f"{'an' if title[0] in 'AEIOU' else 'a'} {title}"


def _identity_at(bus: I2cBus, interface: Interface, address: int | None) -> tuple[int, int] | None:
    try:
        values = I2cClient(bus, interface, address, retries=0).telemetry(IDENTIFICATION.name)
    except (NodeError, InterfaceError):  # nobody there, or a device without this frame
        return None
    kind, version = (int(values[field.name]) for field in IDENTIFICATION.fields[:2])
    return kind, version


def _open_service_port(target: Target, text: str, tape: HostRecorder | None) -> int:
    if target.interface.service_port is None:
        target.close()
        raise TargetError(f"{target.interface.name} has no bench protocol: leave out --bench")
    baud = target.interface.service_port.baud
    line = open_transport(text, baud)
    target.service_port = line if tape is None else tape.line(line, "bench_uart", baud)
    target.on_close.append(line.close)
    return baud


def connect(text: str, device: str | None = None, *, baud: int | None = None) -> Any:
    """The client of the device that ``text`` names, such as ``"/dev/ttyUSB0"``.

    Its class is the device's own. ``device`` is needed if the text does not name it. Closing it
    closes the port. Raises as ``open_target`` does.
    """
    target = open_target(text, device, baud=baud)
    if target.device is None:
        raise TargetError(f"{text}: no registered device")
    client = target.device.client(target.node)
    client.close_with(target.close)
    return client


def _registers(
    interface: Interface, bus: I2cBus, wait: Callable[[float], None]
) -> RegisterClient | None:
    registers = interface.registers
    return None if registers is None else RegisterClient(bus, registers, wait=wait)


def device_at(text: str, name: str | None) -> AnyDevice:
    """The device at a serial line or bus: ``name``, or the one with the I2C address in ``text``;
    raises TargetError if neither tells it."""
    return _parse_i2c(text, name)[2] if text.startswith(I2C) else device_of(name, text)


def _parse_i2c(text: str, name: str | None) -> tuple[int, int | None, AnyDevice]:
    """Number of the bus, address if it is given, and device."""
    bus_text, _, address_text = text.removeprefix(I2C).partition(":")
    try:
        number = int(bus_text)
        address = int(address_text, 0) if address_text else None
    except ValueError:
        number, address = -1, None
    if number < 0 or (address is not None and not 0x08 <= address <= 0x77):
        raise TargetError(f"{text}: must be i2c:BUS:ADDR, as in i2c:7:0x1a (0x08 to 0x77)")
    found = (known.name for known in devices() if address in _addresses(known.interface))
    return number, address, device_of(name or next(found, None), text)


def _open_i2c(text: str, name: str | None, tape: HostRecorder | None) -> Target:
    number, address, owner = _parse_i2c(text, name)
    interface = owner.interface
    opened = _open_bus(number)
    bus: I2cBus = opened if tape is None else tape.bus(opened)
    own = None if address in _addresses(interface)[1:] else address
    _check_identity(text, owner, lambda: _identity_at(opened, interface, own), opened.close)
    node, registers = I2cClient(bus, interface, own), _registers(interface, bus, time.sleep)
    on_close = [opened.close]
    return Target(text, interface, node, registers=registers, device=owner, on_close=on_close)


def _open_bus(number: int) -> SMBus:
    """The device file of bus ``number``, or else the emulated bus of that number."""
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
    owner = device_of(recording.device, text)
    interface = owner.interface
    bus = RecordedI2c(recording, interface)
    spoken = "uart" in recording.bauds and recording.sent("uart", "host")[0]
    if spoken or (not recording.transfers and "uart" in recording.bauds):
        line = RecordedTransport(recording, interface)
        target = Target(text, interface, NodeClient(line, interface), line)
    else:
        target = Target(text, interface, I2cClient(bus, interface, wait=_no_wait))
    target.registers = _registers(interface, bus, _no_wait)
    target.device = owner
    if "bench_uart" in recording.bauds:
        target.service_port = RecordedTransport(recording, interface, "bench_uart")
    return target


def _no_wait(_seconds: float) -> None:
    """Waiting takes no time with a recording."""

"""Checks of telecommands whose effect is more than a setting to read back.

For devices whose tables have the messages named here.
"""

from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.codec.switch_messages import (
    SET_PROFILE,
    SET_SWITCH,
    SHOWN,
    apply_command,
    read_switches,
    shown_values,
    switch_parameters,
)
from cubestack.firmware_model.interface.codec.switches import PROFILES, Switches
from cubestack.host.conformance.contract import CheckRun, FailedError
from cubestack.host.errors import CommandRefusedError

UPLOADED = 3
"""Number of the uploaded block."""

AHEAD_BLOCKS = 16
BITS_PER_BLOCK = 1400
"""Step of virtual time in s; bytes that arrive in it are kept."""


def check_stream(run: CheckRun, message: Message, seen: list[str], *, picture_bytes: int) -> None:
    """An image of ``picture_bytes`` is streamed; its blocks equal those requested singly."""
    node, controls, interface = run.node, run.target.controls, run.target.interface
    length = interface.telemetry("ImageBlock").length
    count = picture_bytes // length
    first = last = b""
    for number, block in enumerate(node.stream(message.name, count)):
        if len(block) != length:
            raise FailedError(f"block {number} has {len(block)} bytes, declared {length}")
        first, last = (first or block), block
        if controls is not None and number % AHEAD_BLOCKS == 0:
            controls.advance(AHEAD_BLOCKS * BITS_PER_BLOCK / interface.baud)
    node.wait_processed(1.0)
    for number, block in ((0, first), (count - 1, last)):
        if _block(run, number) != block:
            raise FailedError(f"block {number} of the stream differs from the one requested singly")
    seen.append(f"{count} blocks")


def check_upload(run: CheckRun, message: Message, seen: list[str]) -> None:
    """An uploaded block arrives at its address and is counted."""
    interface = run.target.interface
    length = interface.telemetry("ImageBlock").length
    data = bytes((17 * index + 5) % 256 for index in range(length))
    run.perform("UploadImage", {})
    run.perform(message.name, {"BlockNumber": UPLOADED, "Data": data})
    status = run.target.node.telemetry("UploadStatus")
    wanted = {"NextBlock": UPLOADED + 1, "BlocksReceived": 1}
    if status != wanted:
        raise FailedError(f"UploadStatus is {status}, after one block {wanted}")
    if _block(run, UPLOADED) != data:
        raise FailedError(f"block {UPLOADED} is not what was uploaded")
    seen.append("read back")


def check_watchdog(run: CheckRun, message: Message, seen: list[str]) -> None:
    """The watchdog resets the device, which counts the reset."""
    node = run.target.node
    before = int(node.telemetry("ExtendedIdentification")["WDGResetCount"])
    run.perform(message.name, {})
    after = node.telemetry("ExtendedIdentification")
    cause = run.target.interface.telemetry("ExtendedIdentification").field("ResetCause")
    count = int(after["WDGResetCount"])
    if count != before + 1:
        raise FailedError(f"WDGResetCount was {before}, is {count}")
    if cause.label(after["ResetCause"]) != "WATCHDOG":
        raise FailedError(f"ResetCause is {cause.label(after['ResetCause'])}, declared WATCHDOG")
    if not before:
        run.perform("ClearWDGResetCounter", {})
    seen.append("reset and counted")


def check_camera_register(
    run: CheckRun, message: Message, seen: list[str], *, address: int
) -> None:
    """A camera register reads back as written; it is restored."""
    before = _camera_register(run, address)
    for value in (before ^ 1, before):
        run.perform(message.name, {"Address": address, "Value": value})
        found = _camera_register(run, address)
        if found != value:
            raise FailedError(f"{value:#x} was written to {address:#x}, {found:#x} is read back")
    seen.append("read back")


def check_profile(run: CheckRun, message: Message, seen: list[str]) -> None:
    """Each profile reads back after it is set; the switches are restored."""
    changes = _Changes(run)
    before = changes.now
    for profile in PROFILES:
        changes.make(message, Profile=profile)
    single = run.target.interface.telecommand(SET_SWITCH)
    for name, one in before.declared().items():
        if not one.hardware:
            changes.make(single, **switch_parameters(name, getattr(before, name)))
    changes.tell(seen)


def check_switch(run: CheckRun, message: Message, seen: list[str]) -> None:
    """Each value of a switch reads back and changes no other; board switches are rejected."""
    changes = _Changes(run)
    for place, (name, one) in enumerate(changes.now.declared().items()):
        if one.hardware:
            run.expect_error(bytes([message.id, place, 0]), "BAD_PARAMETER", f"switch {name}")
            continue
        for value in (*one.choices, getattr(changes.now, name)):
            changes.make(message, **switch_parameters(name, value))
    changes.tell(seen)


#: Checks of the switch telecommands.
OF_SWITCHES = {SET_PROFILE: check_profile, SET_SWITCH: check_switch}


def _switches(run: CheckRun) -> Switches:
    return read_switches(run.target.interface.switches, run.target.node.telemetry(SHOWN))


class _Changes:
    """Sets switches and checks the telemetry.

    Firmware with one profile must reject every change and nothing else.
    """

    def __init__(self, run: CheckRun) -> None:
        self._run, self.now = run, _switches(run)
        self._made = self._refused = 0

    def make(self, message: Message, **parameters: str) -> None:
        """Send a telecommand; telemetry must then show the expected switches."""
        wanted = apply_command(self.now, message.name, message.unpack(message.pack(**parameters)))
        try:
            self._run.perform(message.name, parameters)
            self._made += wanted != self.now
            self.now = wanted
        except CommandRefusedError:
            if wanted == self.now or self._made:
                raise
            self._refused += 1
        found = self._run.target.node.telemetry(SHOWN)
        if found != shown_values(self.now):
            text = f"{SHOWN} is {found}, not {shown_values(self.now)}"
            raise FailedError(f"{parameters} was set, {text}")

    def tell(self, seen: list[str]) -> None:
        """Fail if some changes were rejected and others made."""
        if self._refused and self._made:
            raise FailedError(f"{self._refused} changes were refused, {self._made} were made")
        seen.append("the present one alone" if self._refused else "read back")


def _camera_register(run: CheckRun, address: int) -> int:
    run.perform("SelectCameraRegister", {"Address": address})
    shown = run.target.node.telemetry("CameraRegister")
    if not shown["Valid"] or shown["Address"] != address:
        raise FailedError(f"register {address:#x} of the camera is not read: {shown}")
    return int(shown["Value"])


def _block(run: CheckRun, number: int) -> Value:
    select = run.target.interface.telecommand("ImageBlockSet")
    run.perform(select.name, select.reset_values() | {"BlockNumber": number})
    return run.target.node.telemetry("ImageBlock")["Block"]

"""Telecommands whose success takes more to see than a setting that is read back."""

from collections.abc import Callable

from cubestack.firmware_model.interface.aramis import IMAGE_BYTES as ARAMIS_IMAGE_BYTES
from cubestack.firmware_model.interface.cameras.mlx75412 import REGISTERS as MLX75412
from cubestack.firmware_model.interface.cameras.mt9m001 import REGISTERS as MT9M001
from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.codec.message import Message
from cubestack.firmware_model.interface.cubestar import IMAGE_BYTES as CUBESTAR_IMAGE_BYTES
from cubestack.host.clients.node import NodeClient
from cubestack.host.conformance.actions import perform
from cubestack.host.conformance.suite import FailedError, SkippedError, Suite

__all__ = ["TASKS"]

#: Bytes of a whole picture, by device.
PICTURE_BYTES = {"CubeStar": CUBESTAR_IMAGE_BYTES, "AraMiS": ARAMIS_IMAGE_BYTES}

#: A camera register that the firmware sets up anew before it counts, by device: the exposure, of
#: CubeStar its lower byte.
CAMERA_REGISTERS = {
    "CubeStar": MLX75412["EXPOSURE"].address + 1,
    "AraMiS": MT9M001["SHUTTER_WIDTH"].address,
}

UPLOADED = 3
"""Number of the block that is uploaded."""

AHEAD_BLOCKS = 16
BITS_PER_BLOCK = 1400
"""So much time passes at once in an emulation; what comes meanwhile is kept."""


def check_stream(suite: Suite, message: Message, seen: list[str]) -> None:
    """A whole picture comes, in blocks that are the same when they are asked for one by one."""
    node, controls = suite.target.node, suite.target.controls
    if not isinstance(node, NodeClient):
        raise SkippedError("needs a serial line")
    interface = suite.target.interface
    length = interface.telemetry("ImageBlock").length
    count = PICTURE_BYTES[interface.name] // length
    first = last = b""
    for number, block in enumerate(node.stream(message.name, count)):
        if len(block) != length:
            raise FailedError(f"block {number} has {len(block)} bytes, declared {length}")
        first, last = (first or block), block
        if controls is not None and number % AHEAD_BLOCKS == 0:
            controls.advance(AHEAD_BLOCKS * BITS_PER_BLOCK / interface.baud)
    node.wait_processed(1.0)
    for number, block in ((0, first), (count - 1, last)):
        if _block(suite, number) != block:
            raise FailedError(f"block {number} of the stream is another one when it is asked for")
    seen.append(f"{count} blocks")


def check_upload(suite: Suite, message: Message, seen: list[str]) -> None:
    """A block arrives where it belongs, and is counted."""
    interface = suite.target.interface
    length = interface.telemetry("ImageBlock").length
    data = bytes((17 * index + 5) % 256 for index in range(length))
    perform(suite, interface.telecommand("UploadImage"), {})
    perform(suite, message, {"BlockNumber": UPLOADED, "Data": data})
    status = suite.target.node.telemetry("UploadStatus")
    wanted = {"NextBlock": UPLOADED + 1, "BlocksReceived": 1}
    if status != wanted:
        raise FailedError(f"UploadStatus is {status}, after one block {wanted}")
    if _block(suite, UPLOADED) != data:
        raise FailedError(f"block {UPLOADED} is not what was uploaded")
    seen.append("read back")


def check_watchdog(suite: Suite, message: Message, seen: list[str]) -> None:
    """The device goes on until its watchdog resets it, which it counts."""
    node = suite.target.node
    before = int(node.telemetry("ExtendedIdentification")["WDGResetCount"])
    perform(suite, message, {})
    after = node.telemetry("ExtendedIdentification")
    cause = suite.target.interface.telemetry("ExtendedIdentification").field("ResetCause")
    count = int(after["WDGResetCount"])
    if count != before + 1:
        raise FailedError(f"WDGResetCount was {before}, is {count}")
    if cause.label(after["ResetCause"]) != "WATCHDOG":
        raise FailedError(f"ResetCause is {cause.label(after['ResetCause'])}, declared WATCHDOG")
    if not before:
        perform(suite, suite.target.interface.telecommand("ClearWDGResetCounter"), {})
    seen.append("reset and counted")


def check_camera_register(suite: Suite, message: Message, seen: list[str]) -> None:
    """A register of the camera is read back as written, and put back."""
    address = CAMERA_REGISTERS[suite.target.interface.name]
    before = _camera_register(suite, address)
    for value in (before ^ 1, before):
        perform(suite, message, {"Address": address, "Value": value})
        found = _camera_register(suite, address)
        if found != value:
            raise FailedError(f"{value:#x} was written to {address:#x}, {found:#x} is read back")
    seen.append("read back")


def _camera_register(suite: Suite, address: int) -> int:
    perform(suite, suite.target.interface.telecommand("SelectCameraRegister"), {"Address": address})
    shown = suite.target.node.telemetry("CameraRegister")
    if not shown["Valid"] or shown["Address"] != address:
        raise FailedError(f"register {address:#x} of the camera is not read: {shown}")
    return int(shown["Value"])


def _block(suite: Suite, number: int) -> Value:
    """A block of the picture in memory."""
    select = suite.target.interface.telecommand("ImageBlockSet")
    perform(suite, select, select.reset_values() | {"BlockNumber": number})
    return suite.target.node.telemetry("ImageBlock")["Block"]


#: Checks of a telecommand's effect, by its name.
TASKS: dict[str, Callable[[Suite, Message, list[str]], None]] = {
    "StreamDownImage": check_stream,
    "UploadBlock": check_upload,
    "TestWDG": check_watchdog,
    "WriteCameraRegister": check_camera_register,
}

"""A node's host: frames and messages on both buses, without a line between."""

from typing import Any

from cubestack.firmware_model.interface.codec.frames import FrameDecoder, FrameEvent, encode_frame
from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.firmware_model.node.link import SatelliteLink


def write_bytes(link: Any, data: bytes) -> int:
    """Start a write transfer; how many bytes were acknowledged before the first that was not."""
    link.i2c_start(False)
    for count, byte in enumerate(data):
        if not link.i2c_write(byte):
            return count
    return len(data)


class HostSide:
    """The node's UART and I2C address as its host sees them."""

    interface: Interface
    link: SatelliteLink

    def __init__(self) -> None:
        self.sent = bytearray()  #: bytes that the node gave to its UART since a test took them
        self.backlog = 0  #: bytes that the UART still has to send

    # --- what the program uses --------------------------------------------------------------------

    def uart_send(self, data: bytes) -> None:
        self.sent += data

    def uart_backlog(self) -> int:
        return self.backlog

    # --- UART -------------------------------------------------------------------------------------

    def wire(self, data: bytes) -> bytes:
        """Send raw bytes; the bytes that come back at once."""
        for byte in data:
            self.link.uart_byte(byte)
        answer = bytes(self.sent)
        self.sent.clear()
        return answer

    def uart(self, data: bytes) -> list[bytes]:
        """Send raw bytes; payloads of the frames that come back at once."""
        for byte in data:
            self.link.uart_byte(byte)
        return self.received()

    def frames(self, payload: bytes) -> list[bytes]:
        """Send a frame; payloads of the frames that come back at once."""
        return self.uart(encode_frame(payload))

    def received(self) -> list[bytes]:
        """Payloads of the frames that came since the last call."""
        decoder, frames = FrameDecoder(1024), []
        for byte in self.sent:
            event = decoder.feed(byte)
            assert event in (None, FrameEvent.FRAME), f"the node sent {bytes(self.sent)!r}"
            if event is FrameEvent.FRAME:
                frames.append(decoder.payload)
        assert not decoder.unfinished
        self.sent.clear()
        return frames

    def send(self, name: str, **values: object) -> int:
        """Send a telecommand, others than ``values`` as after a reset; its error byte."""
        message = self.interface.telecommand(name)
        values = {**message.reset_values(), **values}
        (answer,) = self.frames(bytes([message.id]) + message.pack(**values))
        (error,) = answer
        return error

    def command(self, *names: str, **values: object) -> None:
        """Send telecommands, which must be accepted, and run each to its end before the next."""
        for name in names:
            assert self.send(name, **values) == 0
            self.run()

    def telemetry(self, name: str) -> dict[str, Any]:
        message = self.interface.telemetry(name)
        (answer,) = self.frames(bytes([message.id]))
        return dict(message.unpack(answer))

    def run(self) -> None: ...

    # --- I2C --------------------------------------------------------------------------------------

    def i2c_write(self, data: bytes) -> int:
        """A write transfer; how many bytes were acknowledged before the first that was not."""
        count = write_bytes(self.link, data)
        self.link.i2c_stop()
        return count

    def i2c_read(self, count: int, identifier: int | None = None) -> bytes:
        """A read transfer, with a write of ``identifier`` and a repeated start before if given."""
        if identifier is not None:
            assert write_bytes(self.link, bytes([identifier])) == 1
        self.link.i2c_start(True)
        data = bytes(self.link.i2c_read() for _ in range(count))
        self.link.i2c_stop()
        return data

"""The register-pointer protocol on the backup UART; interrupt context.

CubeSense thesis, section 6.4.3: the same protocol as on I2C. A message is the slave's address with
the direction in its lowest bit, a register's address and, to write, one data byte. The answer to a
read is the register's value, without another address, because a UART has no repeated start.
Assumed: bytes before the slave's address are ignored; a long silence ends an incomplete message;
where I2C reads fill bytes, there is no answer; a message that begins while an image is sent ends
it.
"""

from dataclasses import dataclass

from cubestack.firmware_model.cubesense.download import ImageSender
from cubestack.firmware_model.cubesense.hardware import Port
from cubestack.firmware_model.cubesense.jobs import Background
from cubestack.firmware_model.cubesense.links.registers import RegisterLink
from cubestack.firmware_model.interface.cubesense.registers import REGISTERS
from cubestack.firmware_model.mcu.requests import Routine


@dataclass(eq=False)
class BackupUart:
    """Messages on the node's UART, in place of the node protocol's; the pointer is not kept."""

    registers: RegisterLink  #: the registers that they read and write

    def __post_init__(self) -> None:
        link = self.registers
        self._image = ImageSender(link.hardware, link.meter, link.reader, Port.NODE)
        self._work = Background(self._send)
        self._sending = False
        self._message = bytearray()

    def uart_byte(self, byte: int) -> None:
        self.registers.meter.charge(uart_interrupt=1)
        if not self._message and byte >> 1 != REGISTERS.i2c_address:
            return
        self._sending = False
        self._message.append(byte)
        reads = self._message[0] & 1
        if len(self._message) < 3 - reads:
            return
        _, address, *data = self._message
        self._message.clear()
        if reads:
            self._answer(address)
        else:
            self.registers.write(address, *data)

    def uart_silence(self) -> None:
        """Interrupt: nothing was received for a while; an incomplete message is dropped."""
        self._message.clear()

    def _answer(self, address: int) -> None:
        register = REGISTERS.at(address)
        if register is None or not register.readable:
            return
        if not register.streams:
            self._image.send(self.registers.read(register))
            return
        self._sending = True
        self._image.begin()
        if self.registers.queue.request(self._work):
            self.registers.hardware.wake()

    def _send(self) -> Routine[None]:
        """Main loop: send a piece of the image, and queue the next one."""
        sram = self.registers.state.image_sram
        done = not self._sending or (yield from self._image.send_some(sram))
        if self._sending and not done:
            self.registers.queue.request(self._work)
        self._sending = self._sending and not done

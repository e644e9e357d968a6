"""In-process I2C link: a host in the same Python process drives virtual time by waiting.

Of smbus2 it has the one method that carries any transfer (i2c_rdwr);
``cubestack.host.transport.smbus.CubeSMBus`` adds the others. Only waiting advances virtual time, so
a run is reproducible.
"""

import errno
from typing import Any

from cubestack.emulator.bus.i2c import I2cBus, I2cMessage
from cubestack.emulator.i2cdev.adapter import I2cAdapter
from cubestack.emulator.i2cdev.device_file import DeviceFile
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel
from cubestack.firmware_model.formats.i2c_socket import Call, split_reply

I2C_M_RD = 0x0001
"""Flag of a reading message in linux/i2c.h, the only one that is supported."""


class DirectI2c:
    """The host's end of an I2C bus: smbus2's ``i2c_rdwr``, and calls of a device file."""

    def __init__(self, env: Kernel, bus: I2cBus) -> None:
        self._env = env
        self._bus = bus
        self._file = DeviceFile(I2cAdapter(env, bus))

    def i2c_rdwr(self, *messages: Any) -> None:
        """Perform one combined transfer of smbus2 ``i2c_msg`` objects.

        Raises OSError: I2cError if a byte is not acknowledged, EOPNOTSUPP for flags other than
        I2C_M_RD.
        """
        plain = [_to_plain(message) for message in messages]
        self._env.run(until=self._env.process(self._bus.transfer(plain)))
        for message, done in zip(messages, plain, strict=True):
            if done.read:
                for index, byte in enumerate(done.data):
                    message.buf[index] = bytes([byte])

    def call(self, call: Call, body: bytes) -> tuple[int, bytes]:
        """Perform a packed call of the device file (``firmware_model/formats/i2c_socket.py``).

        Returns the result, 0 or more or a negative errno, and data.
        """
        replies: list[bytes] = []
        self._file.perform(call, body, replies.append)
        while not replies:
            self._env.step()
        return split_reply(replies[0])

    def close(self) -> None: ...

    def wait(self, seconds: float) -> None:
        self._env.advance_to(self._env.now + int(seconds * PS_PER_S))


def _to_plain(message: Any) -> I2cMessage:
    if message.flags & ~I2C_M_RD:
        raise OSError(
            errno.EOPNOTSUPP, f"I2C message flags {message.flags:#06x}: only reading is supported"
        )
    if message.flags & I2C_M_RD:
        return I2cMessage(message.addr, read=message.len)
    # Not bytearray(message): through the buffer protocol, that is the ctypes structure itself.
    return I2cMessage(message.addr, bytearray(bytes(message)))

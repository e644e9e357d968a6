"""Client of a register-pointer protocol on I2C, through any object with smbus2's ``i2c_rdwr``.

``RegisterLine`` is such an object for a serial line with the same protocol.

Registers come from a map (CubeSense thesis, section 6.4.3). The slave cannot reject anything, so
this client rejects what the map forbids before sending.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from smbus2 import i2c_msg

from cubestack.firmware_model.interface.codec.field import InterfaceError, Value
from cubestack.firmware_model.interface.codec.register_pointer import PointerMap, PointerRegister
from cubestack.host.clients.contract import Exchanges, Progress
from cubestack.host.clients.i2c import I2cBus, T, acknowledged
from cubestack.host.transport.streams import READ_BYTES, Transport

#: Longest read of the Linux kernel's I2C_RDWR.
CHUNK_BYTES = 8192

#: Flag of a read message.
I2C_READ = 1


class RegisterClient:
    """Reads and writes registers by name; the caller closes the bus.

    Attributes:
        registers: the map.
        exchanges: counts so far; a streaming register counts once.
    """

    def __init__(
        self,
        bus: I2cBus,
        registers: PointerMap,
        address: int | None = None,
        *,
        wait: Callable[[float], None] = time.sleep,
        retries: int = 2,
    ) -> None:
        """Talk to the slave at 7-bit ``address`` (default: the map's).

        Unacknowledged reads are repeated up to ``retries`` times with ``wait`` between them; writes
        never, as they may have been executed.
        """
        self.registers, self.exchanges = registers, Exchanges()
        self._bus = bus
        self._address = registers.i2c_address if address is None else address
        self._wait = wait
        self._retries = retries

    @property
    def on_line(self) -> bool:
        """Whether the bus is a serial line, which answers only for existing registers."""
        return isinstance(self._bus, RegisterLine)

    def read(self, name: str) -> Value:
        """The value of a register, in the map's unit; raises InterfaceError, NoAnswerError."""
        register = self._readable(name)
        return register.decode(self._fetch(register, None))

    def read_stream(self, name: str, progress: Progress | None = None) -> bytes:
        """All bytes of a streaming register, in reads of at most 8192 bytes.

        ``progress`` is called with (bytes done, total). Raises as ``read`` does.
        """
        return self._fetch(self._readable(name), progress)

    def write(self, name: str, value: object) -> None:
        """Write a register: a number, or the name of a choice.

        Raises InterfaceError for an invalid name or value, NoAnswerError.
        """
        register = self.registers[name]
        if not register.writable:
            raise InterfaceError(f"register {register.name} is read-only")
        data = register.encode(value, saturate=False)
        if not register.allows(register.decode(data)):
            raise InterfaceError(f"register {register.name}: {value!r} is out of range")
        self._attempt(lambda: self.write_raw(register.address, data), register, 1)

    def read_raw(self, address: int, count: int) -> bytes:
        """Bytes from any address, declared or not, in one transfer; raises OSError."""
        answer = i2c_msg.read(self._address, count)
        self._bus.i2c_rdwr(i2c_msg.write(self._address, [address]), answer)
        return bytes(answer)

    def write_raw(self, address: int, data: bytes) -> None:
        """Write bytes to any address, allowed or not, in one transfer; raises OSError."""
        self._bus.i2c_rdwr(i2c_msg.write(self._address, bytes([address]) + data))

    def _readable(self, name: str) -> PointerRegister:
        register = self.registers[name]
        if not register.readable:
            raise InterfaceError(f"register {register.name} is write-only")
        return register

    def _fetch(self, register: PointerRegister, progress: Progress | None) -> bytes:
        """All bytes of a register; an aborted transfer starts again."""

        def fetch() -> bytes:
            data = bytearray()
            while len(data) < register.length:
                answer = i2c_msg.read(self._address, min(CHUNK_BYTES, register.length - len(data)))
                if data:  # without the pointer, a read continues where the last one stopped
                    self._bus.i2c_rdwr(answer)
                else:
                    self._bus.i2c_rdwr(i2c_msg.write(self._address, [register.address]), answer)
                data += bytes(answer)
                if progress is not None:
                    progress(len(data), register.length)
            return bytes(data)

        return self._attempt(fetch, register, 1 + self._retries)

    def _attempt(self, transfer: Callable[[], T], register: PointerRegister, attempts: int) -> T:
        times = f"{attempts} attempt" + ("s" if attempts > 1 else "")
        where = f"I2C address {self._address:#04x} in {times}"
        what = f"register {register.name} not acknowledged at {where}"
        return acknowledged(transfer, attempts, self._wait, what, self.exchanges)


@dataclass(eq=False)
class RegisterLine:
    """A serial line used as the bus of a ``RegisterClient``.

    A message is the slave's address with the direction in its lowest bit, the register's address
    and, to write, one data byte (CubeSense thesis, section 6.4.3). The line stays its owner's;
    ``timeout_s`` is the longest silence.
    """

    line: Transport
    timeout_s: float = 1.0
    _ahead: bytearray = field(default_factory=bytearray, init=False)  # of a continued read

    def i2c_rdwr(self, *i2c_msgs: i2c_msg) -> None:
        """A write, a write and read, or a continued read; raises TimeoutError."""
        *_, last = i2c_msgs
        reads = bool(last.flags & I2C_READ)
        if len(i2c_msgs) > reads:
            self._ahead.clear()
            while self.line.read(READ_BYTES, 0.0):  # drop late bytes
                pass
            self.line.write(bytes([last.addr << 1 | reads]) + bytes(i2c_msgs[0]))
        if not reads:
            return
        while len(self._ahead) < last.len:
            data = self.line.read(READ_BYTES, self.timeout_s)
            if not data:
                raise TimeoutError(f"{len(self._ahead)} of {last.len} bytes came")
            self._ahead += data
        for index in range(last.len):
            last.buf[index] = bytes([self._ahead[index]])
        del self._ahead[: last.len]

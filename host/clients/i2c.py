"""Client of a node on I2C, through any object with smbus2's ``i2c_rdwr``.

Telemetry is one transfer: write the ID, repeated start, read the data. A telecommand is one write
without an error byte, so only telemetry shows a rejection: TcmdProcessed if it has an error code,
else ErrorFlags. This client therefore rejects invalid telecommands before sending.
"""

import time
from collections.abc import Callable
from typing import Any, Protocol, TypeVar

from smbus2 import i2c_msg

from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.host.clients.contract import Client, Exchanges
from cubestack.host.errors import CommandRefusedError, NoAnswerError, TransportError

RETRY_PERIOD_S = 0.01

T = TypeVar("T")


class I2cBus(Protocol):
    """The part of smbus2's SMBus that carries any transfer."""

    def i2c_rdwr(self, *i2c_msgs: Any) -> None:
        """One combined transfer; raises OSError when a message is not acknowledged."""


def acknowledged(
    transfer: Callable[[], T],
    attempts: int,
    wait: Callable[[float], None],
    what: str,
    exchanges: Exchanges,
) -> T:
    """Result of ``transfer`` after up to ``tries``; raises NoAnswerError ``what`` if all fail.

    Counts the traffic in ``exchanges``.
    """
    failure = None
    for attempt in range(attempts):
        if attempt:
            wait(RETRY_PERIOD_S)
        exchanges.sent += 1
        exchanges.repeated += attempt > 0
        try:
            found = transfer()
        except TransportError:
            raise
        except OSError as error:
            failure = error
            exchanges.ended(False)
        else:
            exchanges.ended(True)
            return found
    raise NoAnswerError(what) from failure


class I2cClient(Client):
    """Client on an I2C bus."""

    def __init__(
        self,
        bus: I2cBus,
        interface: Interface,
        address: int | None = None,
        *,
        wait: Callable[[float], None] = time.sleep,
        processing_timeout_s: float = 10.0,
        retries: int = 2,
    ) -> None:
        """Talk to the node at 7-bit ``address`` (default: the interface's).

        ``wait`` sleeps between polls; a telecommand may take ``processing_timeout_s``.
        Unacknowledged telemetry requests are repeated up to ``retries`` times.
        """
        self.interface = interface
        self._bus = bus
        self._address = interface.i2c_address if address is None else address
        self._wait = wait
        self._processing_timeout_s = processing_timeout_s
        self._retries = retries

    def command(self, name: str, **parameters: object) -> None:
        """Send a telecommand and wait until the node has processed it; errors as ``Client``'s."""
        message = self.interface.telecommand(name)
        data = message.pack(**parameters)
        wrong = message.violations(message.unpack(data))
        if wrong:
            code = self.interface.ack_errors["BAD_PARAMETER"]
            raise CommandRefusedError(message.name, code, f", {wrong[0][0].name} is out of range")
        what = f"telecommand {message.name} not acknowledged at I2C address {self._address:#04x}"
        write = i2c_msg.write(self._address, bytes([message.id]) + data)
        acknowledged(lambda: self._bus.i2c_rdwr(write), 1, self._wait, what, self.exchanges)
        values = self.wait_processed(self._processing_timeout_s)
        self._check_error(message, int(values.get("Error", 0)))

    def telemetry(self, name: str) -> dict[str, Value]:
        """Read a telemetry frame; a stepping one may skip a record after an aborted transfer."""
        message = self._asked(name)

        def read() -> bytes:
            answer = i2c_msg.read(self._address, message.length)
            self._bus.i2c_rdwr(i2c_msg.write(self._address, [message.id]), answer)
            return bytes(answer)

        attempts = 1 + self._retries
        where = f"I2C address {self._address:#04x} in {attempts} attempts"
        what = f"telemetry {message.name} not acknowledged at {where}"
        return message.unpack(acknowledged(read, attempts, self._wait, what, self.exchanges))

    def pause(self, seconds: float) -> None:
        """Let time pass on the node's side."""
        self._wait(seconds)

    def close(self) -> None:
        """Do nothing: the caller closes the bus."""

"""A device on the bench: powered up, with a client, and with a look at both ends of its lines."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache, partial
from typing import Any

from smbus2 import i2c_msg

from cubestack.emulator.boards.aramis.catalogue import CatalogueParameters, build_database
from cubestack.emulator.bus.uart import Uart
from cubestack.emulator.faults.injection import Injection
from cubestack.emulator.scene.earth_sun import EarthSunScene
from cubestack.emulator.scene.sky import SkyScene
from cubestack.emulator.sim.virtual_time import PS_PER_S
from cubestack.firmware_model.aramis.catalogue.database import Database
from cubestack.firmware_model.interface.codec.frames import encode_frame
from cubestack.host.clients.node import NodeClient
from cubestack.host.devices.emulated import AnyEmulated, power_up
from cubestack.host.devices.registry import device
from tests.system.conftest import Ear

SUN_DEG, NADIR_DEG = (20.0, 10.0), (-8.0, 12.0)
ORION_DEG = (84.0, -1.0)

#: Flags of the sky that these tests look at, which no fault raises.
ALWAYS = {"MaxStarsDetection"}


class Wire(Ear):
    """A serial line between a host and a device's end, which is watched.

    Attributes:
        heard: bytes that the device received.
        said: bytes that the device sent.
    """

    def __init__(self, line: Any, uart: Uart) -> None:
        self._line = line
        super().__init__(uart)
        self.heard = self.said = b""

    def ask(self, payload: bytes, timeout_s: float = 0.1) -> bytes:
        """Send a frame with ``payload``; all bytes that come back before a silence."""
        self.heard = self.said = b""
        self._line.write(encode_frame(payload))
        answer = b""
        while piece := self._line.read(1000, timeout_s):
            answer += piece
        return answer

    def device_sent(self, data: bytes, first_ps: int, byte_ps: int) -> None:
        self.said += data

    def device_heard(self, byte: int, start_ps: int) -> None:
        self.heard += bytes([byte])


class Spy:
    """A target on an I2C bus that is watched.

    Attributes:
        seen: what it got: "S w" or "S r" for a start, bytes in hexadecimal, "P" for a stop.
    """

    def __init__(self, target: Any) -> None:
        self._target = target
        self.seen: list[str] = []

    def i2c_start(self, read: bool) -> None:
        self.seen.append("S r" if read else "S w")
        self._target.i2c_start(read)

    def i2c_write(self, byte: int) -> bool:
        self.seen.append(f"{byte:02x}")
        return bool(self._target.i2c_write(byte))

    def i2c_read(self) -> int | None:
        byte: int | None = self._target.i2c_read()
        return byte

    def i2c_stop(self) -> None:
        self.seen.append("P")
        self._target.i2c_stop()


class Bench:
    """One device with a client on its serial line.

    Attributes:
        name: of the device, as the command line has it.
        board: the emulated board.
        device: host's view.
        faults: the board's.
    """

    def __init__(self, opened: AnyEmulated) -> None:
        self.name = opened.device.name
        self.board: Any = opened.board
        self.faults = opened.faults
        self.interface = opened.device.interface
        self.device: Any = opened.client

    @property
    def client(self) -> NodeClient:
        """The host's client."""
        client = self.device.client
        assert isinstance(client, NodeClient)
        return client

    @property
    def now_s(self) -> float:
        """Virtual time."""
        return float(self.board.kernel.now / PS_PER_S)

    @property
    def byte_s(self) -> float:
        """Time of a byte on the serial line."""
        return 10 / self.interface.baud

    def wire(self) -> Wire:
        """Plug a bare line in instead of the client."""
        return Wire(self.board.serial(), self.board.uart)

    def plug_in(self, *, timeout_s: float = 0.1, retries: int = 0) -> NodeClient:
        """A new client, which does not wait as long."""
        client = NodeClient(
            self.board.serial(), self.interface, timeout_s=timeout_s, retries=retries
        )
        self.device.client = client
        return client

    def spy(self) -> Spy:
        """Watch the node's end of the I2C bus."""
        bus, address = self.board.i2c_bus, self.interface.i2c_address
        spy = bus._targets[address] = Spy(bus.targets[address])
        return spy

    def ask_i2c(self) -> bytes:
        """Telemetry Identification over I2C, without the client."""
        message = self.interface.telemetry("Identification")
        answer = i2c_msg.read(self.interface.i2c_address, message.length)
        self.board.i2c().i2c_rdwr(i2c_msg.write(self.interface.i2c_address, [message.id]), answer)
        return bytes(answer)

    def write_i2c(self, data: bytes) -> None:
        """One message to the node."""
        self.board.i2c().i2c_rdwr(i2c_msg.write(self.interface.i2c_address, data))

    def inject(self, kind: str, *, after_s: float = 0.0, **options: Any) -> Injection:
        """Inject a fault, ``after_s`` from now."""
        at_s = self.now_s + after_s if after_s else None
        injection: Injection = self.faults.inject(kind, at_s=at_s, **options)
        return injection

    def during(self, kind: str, act: Callable[[], Any], **options: Any) -> Any:
        """What ``act`` returns with a fault, which is cleared then."""
        self.inject(kind, **options)
        result = act()
        self.faults.clear()
        return result

    def said(self) -> list[str]:
        """What the faults did, without their times."""
        return [str(event).split(": ", 1)[1] for event in self.faults.log]

    def telemetry(self, name: str) -> dict[str, Any]:
        """A telemetry frame."""
        return dict(self.client.telemetry(name))

    def flags(self) -> set[str]:
        """Error flags that are up."""
        name = "CommunicationStatus" if self.name == "cubesense" else "ErrorFlags"
        values = self.telemetry(name)
        return {flag for flag, up in values.items() if up and not flag.endswith("Count")} - ALWAYS


@lru_cache(maxsize=1)
def small_catalogue() -> Database:
    """Stars and triangles of which the test's sky has enough."""
    return build_database(CatalogueParameters(step_deg=10, stars_per_field=5))


SCENES = {
    "cubestar": SkyScene.pointing(*ORION_DEG),
    "cubesense": EarthSunScene.facing(sun_deg=SUN_DEG, nadir_deg=NADIR_DEG),
    "aramis": SkyScene.pointing(*ORION_DEG, 20.0),
}


@contextmanager
def powered(name: str) -> Iterator[Bench]:
    """A device that sees what it is made for."""
    own = {"catalogue": small_catalogue()} if name == "aramis" else {}
    with power_up(device(name), SCENES[name], seed=4, **own) as opened:
        yield Bench(opened)


BENCHES = {name: partial(powered, name) for name in SCENES}

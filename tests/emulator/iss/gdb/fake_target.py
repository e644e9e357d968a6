"""A debug target without a processor, and a session on it."""

from cubestack.emulator.iss.gdb.packets import framed
from cubestack.emulator.iss.gdb.session import Session
from cubestack.emulator.iss.gdb.target import REGISTERS, SIGINT, MemoryRegion, Stop, WatchKind

RAM = 0x2000_0000


class FakeTarget:
    """Registers, 1 kB each of flash and RAM, and a list of the calls."""

    registers = REGISTERS
    regions = (MemoryRegion("flash", 0, 1024, 64), MemoryRegion("ram", RAM, 1024))

    def __init__(self) -> None:
        self.halted: Stop | None = None
        self.values = {name: number for number, name in REGISTERS.items()}
        self.memory = {0: bytearray(b"\xff" * 1024), RAM: bytearray(1024)}
        self.calls: list[tuple[object, ...]] = []

    def halt(self) -> None:
        if self.halted is None:
            self.halted = Stop(SIGINT)

    def resume(self) -> None:
        self.calls.append(("resume",))
        self.halted = None

    def step(self, low: int, high: int) -> None:
        self.calls.append(("step", low, high))
        self.values["pc"] += 2
        self.halted = Stop()

    def register(self, name: str) -> int:
        return self.values[name]

    def set_register(self, name: str, value: int) -> None:
        self.values[name] = value

    def read(self, address: int, count: int) -> bytes:
        for start, memory in self.memory.items():
            if start <= address < start + len(memory):
                return bytes(memory[address - start : address - start + count])
        return b""

    def write(self, address: int, data: bytes) -> bool:
        for start, memory in self.memory.items():
            if start <= address <= start + len(memory) - len(data):
                memory[address - start : address - start + len(data)] = data
                return True
        return False

    def set_breakpoint(self, address: int, on: bool) -> None:
        self.calls.append(("breakpoint", address, on))

    def set_watchpoint(self, address: int, count: int, kind: WatchKind, on: bool) -> None:
        self.calls.append(("watchpoint", address, count, kind, on))

    def attach(self) -> None:
        self.halt()

    def detach(self) -> None:
        self.calls.append(("detach",))
        self.halted = None

    def restart(self) -> None:
        self.calls.append(("restart",))
        self.halted = Stop()

    def monitor(self, command: str) -> str:
        if command == "time":
            return "0.5 s"
        raise ValueError(f"no command {command!r}")


class Talk:
    """A session on a fake target."""

    def __init__(self) -> None:
        self.target = FakeTarget()
        self.session = Session(self.target)

    def ask(self, data: bytes | str) -> bytes | None:
        """Send a packet; returns the data of the answer, or None without answer."""
        self.send(framed(data.encode() if isinstance(data, str) else data))
        return self.answer()

    def send(self, raw: bytes) -> None:
        self.session.receive(raw)
        self.session.look()

    def answer(self) -> bytes | None:
        output = bytes(self.session.output)
        self.session.output.clear()
        if b"$" not in output:
            return None
        body = output[output.index(b"$") + 1 :]
        assert body[-3:] == b"#%02x" % (sum(body[:-3]) & 0xFF)
        return body[:-3]

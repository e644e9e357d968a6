"""A GDB client's session on a target: packets in, answers out.

GDB manual, appendix "GDB Remote Serial Protocol". One thread, all-stop mode. Breakpoints of both
kinds belong to the simulator, so none changes memory.
"""

from collections.abc import Callable
from functools import partial

from cubestack.emulator.iss.gdb import packets
from cubestack.emulator.iss.gdb.target import TARGET_XML, DebugTarget, Stop, WatchKind, memory_map

OK, ERROR, UNKNOWN = b"OK", b"E01", b""
THREAD = b"1"

BREAKPOINT_KINDS = 0, 1
"""Software and hardware breakpoints: the same here, but set and removed independently."""

WATCH_KINDS: dict[int, WatchKind] = {2: "write", 3: "read", 4: "access"}
WATCH_WORDS: dict[WatchKind, str] = {"write": "watch", "read": "rwatch", "access": "awatch"}

FEATURES = (
    f"PacketSize={packets.LARGEST:x};QStartNoAckMode+;qXfer:features:read+;"
    "qXfer:memory-map:read+;swbreak+;hwbreak+;vContSupported+"
)
WORD = 4

MOST_OUTPUT = 1 << 20
"""Bytes that wait for a client; with more, it is disconnected."""

MOST_FLASHED, MOST_BREAKPOINTS, MOST_WATCHPOINTS = 4 << 20, 10_000, 1_000
"""Of one client: bytes between vFlashWrite and vFlashDone, breakpoints and watchpoints."""


class Session:
    """One client on one target, which it halts at the start.

    Attributes:
        output: bytes to send; the owner clears them.
        ended: whether the client has detached or killed the target.
    """

    def __init__(self, target: DebugTarget) -> None:
        self.output = bytearray()
        self.ended = False
        self._target = target
        self._packets = packets.Deframer()
        self._awaiting = False  # the client waits for the target to stop
        self._extended = False  # it can run the target again: "target extended-remote"
        self._last = b""
        self._flashed: dict[int, bytes] = {}
        self._breakpoints: set[tuple[int, int]] = set()  # (kind of packet, address)
        self._watchpoints: set[tuple[int, int, int]] = set()  # and bytes
        target.attach()

    def receive(self, data: bytes) -> None:
        """Handle bytes from the client."""
        for body in self._packets.feed(data):
            self._flush()
            if len(self.output) > MOST_OUTPUT:
                self._packets.foreign = True  # it sends requests and reads no answers
                break
            if body is None:
                self._target.halt()
            elif not self.ended:
                self._answer(self._perform(body))
        if self._packets.again:
            self._packets.again = False
            self.output += self._last
        self._flush()
        if self._packets.foreign:
            self.close()

    def look(self) -> None:
        """Notify the client if the target has halted."""
        stop = self._target.halted
        if self._awaiting and stop is not None:
            self._awaiting = False
            self._answer(self._reason(stop))

    def close(self) -> None:
        """Detach from the target, which then runs."""
        if not self.ended:
            self.ended = True
            self._target.detach()

    def _flush(self) -> None:
        self.output += self._packets.replies
        self._packets.replies.clear()

    def _answer(self, data: bytes | None) -> None:
        if data is not None:
            self._last = packets.framed(data)
            self.output += self._last

    def _perform(self, body: bytes) -> bytes | None:
        """Answer to a packet; None if it comes later or never."""
        for head, act in ((b"X", self._write_binary), (b"vFlashWrite:", self._flash_write)):
            if body.startswith(head):
                where, _, data = body[len(head) :].partition(b":")
                return _or_error(partial(act, where.decode("latin-1"), packets.unescape(data)))
        command = _COMMANDS.get(chr(body[0]) if body else "")
        if command is None:
            return UNKNOWN
        return _or_error(partial(command, self, body[1:].decode("latin-1")))

    # --- state ----------------------------------------------------------------------------------

    def _reason(self, stop: Stop) -> bytes:
        number = {name: number for number, name in self._target.registers.items()}
        text = f"T{stop.signal:02x}thread:{THREAD.decode()};"
        if stop.watch is not None:
            kind, address = stop.watch
            text += f"{WATCH_WORDS[kind]}:{address:x};"
        elif stop.breakpoint:
            text += "hwbreak:;"
        for name in ("sp", "lr", "pc"):
            text += f"{number[name]:02x}:{self._register(name)};"
        return text.encode()

    def _extend(self, _text: str) -> bytes:
        self._extended = True
        return OK

    def _ask(self, _text: str) -> bytes | None:
        stop = self._target.halted
        if stop is None:  # it has been asked to halt, and will
            self._awaiting = True
            return None
        return self._reason(stop)

    def _register(self, name: str) -> str:
        return self._target.register(name).to_bytes(WORD, "little").hex()

    def _read_all(self, _text: str) -> bytes:
        return "".join(self._register(name) for name in self._target.registers.values()).encode()

    def _write_all(self, text: str) -> bytes:
        data = bytes.fromhex(text)
        for index, name in enumerate(self._target.registers.values()):
            word = data[index * WORD : (index + 1) * WORD]
            if len(word) == WORD:
                self._target.set_register(name, int.from_bytes(word, "little"))
        return OK

    def _read_one(self, text: str) -> bytes:
        return self._register(self._target.registers[int(text, 16)]).encode()

    def _write_one(self, text: str) -> bytes:
        number, _, value = text.partition("=")
        data = bytes.fromhex(value)
        if len(data) != WORD:
            return ERROR
        name = self._target.registers[int(number, 16)]
        self._target.set_register(name, int.from_bytes(data, "little"))
        return OK

    def _read_memory(self, text: str) -> bytes:
        address, count = _pair(text)
        data = self._target.read(address, min(count, packets.LARGEST // 2 - 1))
        return data.hex().encode() if data or not count else ERROR

    def _write_memory(self, text: str) -> bytes:
        where, _, data = text.partition(":")
        address, count = _pair(where)
        return self._write(address, count, bytes.fromhex(data))

    def _write_binary(self, where: str, data: bytes) -> bytes:
        return self._write(*_pair(where), data)

    def _write(self, address: int, count: int, data: bytes) -> bytes:
        if len(data) != count:
            return ERROR
        return OK if not data or self._target.write(address, data) else ERROR

    # --- running --------------------------------------------------------------------------------

    def _jump(self, text: str) -> None:
        if text:
            self._target.set_register("pc", int(text, 16))

    def _continue(self, text: str) -> None:
        self._jump(text)
        self._awaiting = True
        self._target.resume()

    def _step(self, text: str) -> None:
        self._jump(text)
        self._step_range(0, 0)

    def _step_range(self, low: int, high: int) -> None:
        self._awaiting = True
        self._target.step(low, high)

    def _point(self, text: str, on: bool) -> bytes:
        kind, address, count = (int(part, 16) for part in text.split(";")[0].split(","))
        if kind in BREAKPOINT_KINDS:
            address &= ~1
            if on and len(self._breakpoints) >= MOST_BREAKPOINTS:
                return ERROR
            (self._breakpoints.add if on else self._breakpoints.discard)((kind, address))
            wanted = any((one, address) in self._breakpoints for one in BREAKPOINT_KINDS)
            self._target.set_breakpoint(address, wanted)
        elif kind in WATCH_KINDS:
            if on and len(self._watchpoints) >= MOST_WATCHPOINTS:
                return ERROR
            (self._watchpoints.add if on else self._watchpoints.discard)((kind, address, count))
            self._target.set_watchpoint(address, max(count, 1), WATCH_KINDS[kind], on)
        else:
            return UNKNOWN
        return OK

    def _verbose(self, text: str) -> bytes | None:
        if text == "Cont?":
            return b"vCont;c;C;s;S;r"
        if text.startswith("Cont;"):
            return self._resume(text.split(";")[1])
        if text.startswith("FlashErase:"):
            address, count = _pair(text.partition(":")[2])
            return OK if self._erase(address, count) else ERROR
        if text == "FlashDone":
            done = [self._target.write(address, data) for address, data in self._flashed.items()]
            self._flashed.clear()
            return OK if all(done) else ERROR
        if text.startswith(("Run", "Attach")):
            if text.startswith("Run"):
                self._target.restart()
            return self._ask("")
        if text.startswith("Kill"):
            # An extended client that wants to run again kills first, and stays.
            return OK if self._extended else self._detach("")
        return UNKNOWN

    def _resume(self, action: str) -> bytes | None:
        word = action.partition(":")[0]  # without the thread
        match word[:1]:
            case "c" | "C":
                self._continue("")
            case "s" | "S":
                self._step_range(0, 0)
            case "r":
                self._step_range(*_pair(word[1:]))
            case _:
                return ERROR
        return None

    def _erase(self, address: int, count: int) -> bool:
        inside = any(
            region.kind == "flash"
            and region.start <= address <= address + count <= region.start + region.length
            for region in self._target.regions
        )
        return inside and self._target.write(address, b"\xff" * count)

    def _flash_write(self, address: str, data: bytes) -> bytes:
        if sum(map(len, self._flashed.values())) + len(data) > MOST_FLASHED:
            return ERROR
        self._flashed[int(address, 16)] = data
        return OK

    def _restart(self, _text: str) -> None:
        self._target.restart()

    def _kill(self, _text: str) -> None:
        self.close()

    def _detach(self, _text: str) -> bytes:
        self.close()
        return OK

    # --- queries --------------------------------------------------------------------------------

    def _query(self, text: str) -> bytes | None:
        name = text.partition(":")[0].partition(",")[0]
        match name:
            case "Supported":
                return FEATURES.encode()
            case "Xfer":
                what, action, annex, where = text.split(":")[1:]
                return self._transfer(what, action, annex, where)
            case "Rcmd":
                return self._monitor(bytes.fromhex(text.partition(",")[2]).decode("latin-1"))
            case "Attached":
                return b"1"
            case "C":
                return b"QC" + THREAD
            case "fThreadInfo":
                return b"m" + THREAD
            case "sThreadInfo":
                return b"l"
            case "Symbol":
                return OK
        return UNKNOWN

    def _transfer(self, what: str, action: str, annex: str, where: str) -> bytes:
        documents = {
            ("features", "target.xml"): lambda: TARGET_XML,
            ("memory-map", ""): lambda: memory_map(self._target.regions),
        }
        if action != "read" or (what, annex) not in documents:
            return b"E00"
        offset, length = _pair(where)
        document = documents[what, annex]().encode()
        part = document[offset : offset + min(length, packets.LARGEST // 2)]
        return (b"m" if offset + len(part) < len(document) else b"l") + packets.escape(part)

    def _monitor(self, command: str) -> bytes:
        try:
            output = self._target.monitor(command)
        except (ValueError, TypeError) as error:
            output = str(error)
        text = output.rstrip("\n") + "\n" if output else ""
        return text.encode("utf-8").hex().encode() or OK

    def _set(self, text: str) -> bytes:
        if text != "StartNoAckMode":
            return UNKNOWN
        self._packets.acknowledging = False  # this packet is already acknowledged
        return OK


def _or_error(act: Callable[[], bytes | None]) -> bytes | None:
    """Result of ``act``, or an error answer for an invalid packet."""
    try:
        return act()
    except (ValueError, LookupError, OverflowError):
        return ERROR


def _pair(text: str) -> tuple[int, int]:
    """Two hexadecimal numbers separated by a comma."""
    first, second = text.split(",")
    return int(first, 16), int(second, 16)


_COMMANDS: dict[str, Callable[[Session, str], bytes | None]] = {
    "?": Session._ask,
    "!": Session._extend,
    "g": Session._read_all,
    "G": Session._write_all,
    "p": Session._read_one,
    "P": Session._write_one,
    "m": Session._read_memory,
    "M": Session._write_memory,
    "c": Session._continue,
    "C": lambda session, text: session._continue(text.partition(";")[2]),  # ignores the signal
    "s": Session._step,
    "S": lambda session, text: session._step(text.partition(";")[2]),
    "Z": lambda session, text: session._point(text, True),
    "z": lambda session, text: session._point(text, False),
    "v": Session._verbose,
    "q": Session._query,
    "Q": Session._set,
    "H": lambda _session, _text: OK,
    "T": lambda _session, _text: OK,
    "k": Session._kill,
    "D": Session._detach,
    "R": Session._restart,
}

"""``monitor`` commands that concern the processor, in the words of OpenOCD, pyOCD and J-Link.

IDEs send them: the debug adapters of cortex-debug, and scripts written for a probe. Commands of the
probe itself have no effect here and are accepted.
"""

from collections.abc import Callable, Mapping
from typing import Protocol

HELP = """halt, resume       stop the processor; let it run
reset [halt|run]   reset, and halt at the first instruction or run
step               run one instruction (gdb does not notice; see flushregs)
reg [NAME]         registers
mdw|mdh|mdb ADDRESS [COUNT], mww|mwh|mwb ADDRESS VALUE   words, half-words, bytes
catch on|off       halt at faults, before their handlers run
semihosting enable|disable   answer BKPT 0xAB, or not"""

ALL_FAULTS = 0x7F0
"""Bits VC_* of DEMCR except the one for a reset: ARMv7-M ARM, C1.6.5."""

CATCHES = {
    "mm_err": 1 << 4, "nocp_err": 1 << 5, "chk_err": 1 << 6, "state_err": 1 << 7,
    "bus_err": 1 << 8, "int_err": 1 << 9, "hard_err": 1 << 10, "all": ALL_FAULTS, "none": 0,
    "reset": 0,
}  # fmt: skip
"""OpenOCD's names of ``cortex_m vector_catch``."""

OF_THE_PROBE = frozenset(
    ("adapter", "adapter_khz", "clrbp", "cortex_m", "device", "echo", "endian", "flash",
     "gdb_breakpoint_override", "gdb_sync", "init", "interface", "itm", "poll", "rtt", "select",
     "set", "sleep", "speed", "swo", "targets", "tpiu", "transport", "version")
)  # fmt: skip

SIZES = {"w": 4, "h": 2, "b": 1}
MOST_SHOWN = 1024


class Processor(Protocol):
    """What the commands act on: ``Debugger``."""

    @property
    def registers(self) -> dict[int, str]: ...

    def halt(self) -> None: ...

    def resume(self) -> None: ...

    def step(self, low: int, high: int) -> None: ...

    def restart(self) -> None: ...

    def register(self, name: str) -> int: ...

    def read(self, address: int, count: int) -> bytes: ...

    def write(self, address: int, data: bytes) -> bool: ...

    def catch_faults(self, mask: int) -> None: ...

    def answer_semihosting(self, on: bool) -> None: ...


def _reset(target: Processor, words: list[str]) -> str:
    match words:
        case [] | ["halt" | "init"]:
            target.restart()
        case ["run" | "resume"]:
            target.restart()
            target.resume()
        case _:
            raise ValueError("usage: reset [halt|init|run]")
    return ""


def _halt(target: Processor, _words: list[str]) -> str:
    target.halt()
    return f"halted at {target.register('pc'):#010x}"


def _resume(target: Processor, _words: list[str]) -> str:
    target.resume()
    return ""


def _step(target: Processor, _words: list[str]) -> str:
    target.step(0, 0)
    return ""


def _registers(target: Processor, words: list[str]) -> str:
    known = list(target.registers.values())
    names = [words[0].lower()] if words else known
    if names[0] not in known:
        raise ValueError(f"no register {names[0]!r}; known: {', '.join(known)}")
    return "\n".join(f"{name:9} {target.register(name):#010x}" for name in names)


def _number(text: str) -> int:
    try:
        return int(text, 0)
    except ValueError:
        raise ValueError(f"{text!r} is not a number") from None


def _show(target: Processor, words: list[str], size: int) -> str:
    address = _number(words[0])
    count = min(_number(words[1]) if len(words) > 1 else 1, MOST_SHOWN)
    data = target.read(address, count * size)
    if len(data) < count * size:
        raise ValueError(f"nothing to read at {address + len(data):#010x}")
    values = [int.from_bytes(data[at : at + size], "little") for at in range(0, len(data), size)]
    lines = []
    for first in range(0, count, 16 // size):
        row = " ".join(f"{value:0{2 * size}x}" for value in values[first : first + 16 // size])
        lines.append(f"{address + first * size:#010x}: {row}")
    return "\n".join(lines)


def _store(target: Processor, words: list[str], size: int) -> str:
    address, value = _number(words[0]), _number(words[1])
    if not target.write(address, (value & (1 << 8 * size) - 1).to_bytes(size, "little")):
        raise ValueError(f"nothing to write at {address:#010x}")
    return ""


def _catch(target: Processor, words: list[str]) -> str:
    mask = 0
    for word in words:
        if word not in CATCHES:
            raise ValueError(f"no fault {word!r}; known: {', '.join(CATCHES)}")
        mask |= CATCHES[word]
    target.catch_faults(mask)
    return ""


def _semihosting(target: Processor, words: list[str]) -> str:
    match words:
        case ["enable" | "1" | "on"]:
            target.answer_semihosting(True)
        case ["disable" | "0" | "off"]:
            target.answer_semihosting(False)
        case ["IOClient" | "ioclient", *_] | []:
            pass
        case _:
            raise ValueError("usage: semihosting enable|disable")
    return ""


_COMMANDS: Mapping[str, Callable[[Processor, list[str]], str]] = {
    "halt": _halt,
    "resume": _resume,
    "go": _resume,
    "step": _step,
    "reset": _reset,
    "jtag_reset": _reset,
    "reg": _registers,
    "semihosting": _semihosting,
}

KNOWN = ("catch", *_COMMANDS, "mdw", "mww")
"""Names to suggest for an unknown command."""


def perform(target: Processor, words: list[str]) -> str | None:
    """Output of a command; None if it is none of these. Raises ValueError for invalid words."""
    match words:
        case ["catch", "on" | "off" as state]:
            return _catch(target, ["all"] if state == "on" else ["none"])
        case ["arm", "semihosting", *rest]:
            return _semihosting(target, rest)
        case ["cortex_m", "vector_catch", *rest]:
            return _catch(target, rest)
        case [("mdw" | "mdh" | "mdb") as name, _, *_]:
            return _show(target, words[1:], SIZES[name[2]])
        case [("mww" | "mwh" | "mwb") as name, _, _]:
            return _store(target, words[1:], SIZES[name[2]])
        case [name, *rest] if name in _COMMANDS:
            return _COMMANDS[name](target, rest)
        case [name, *_] if name in OF_THE_PROBE:
            return ""
    return None

"""Backtrace from registers and stack, by call frame information or else by a stack scan.

A stack scan searches for the next return address: a word that points to the instruction after a
call in the program.
Frames found that way are marked.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from cubestack.emulator.iss.insight.symbols import Symbols

SP, LR, PC, PSP = 13, 14, 15, 18
"""Register numbers of DWARF for the Arm architecture (IHI 0040); PSP is our own."""

DEEPEST = 24
SCANNED_WORDS = 256
"""Stack words that are searched for a return address."""

FRAME_WORDS = 8
"""Words of an exception frame: r0-r3, r12, lr, pc, xpsr. ARMv7-M ARM, B1.5.6."""

PSR_ALIGNED = 1 << 9
"""Bit of the stacked xPSR: a word was skipped to align the frame."""

EXC_RETURNS = (0xFFFF_FFF1, 0xFFFF_FFF9, 0xFFFF_FFFD)
"""Values of LR at exception entry. ARMv7-M ARM, table B1-8."""

INTERRUPTED = "interrupted"

Read = Callable[[int, int], bytes]
"""Reads memory at (address, count); returns fewer bytes at the end of a memory."""


class Frame(NamedTuple):
    """A line of a backtrace."""

    address: int  #: of the running instruction, or of the one after the call
    place: int  #: an address within the call, which identifies the function
    note: str = ""  #: how the frame was found if that is uncertain, or its kind


def backtrace(symbols: Symbols, registers: Mapping[int, int], read: Read) -> list[Frame]:
    """Frames from the newest on; ``registers`` by number, 0 to 15 and ``PSP``."""
    state = dict(registers)
    frames = [Frame(state[PC], state[PC])]
    while len(frames) < DEEPEST:
        note = _unwind(symbols, state, read, frames[-1].place, newest=len(frames) == 1)
        if note is None:
            break
        place = state[PC] if note == INTERRUPTED else state[PC] - 2
        if symbols.functions and symbols.function_at(place) is None:
            break
        frames.append(Frame(state[PC], place, note))
    return frames


def _word(read: Read, address: int) -> int | None:
    data = read(address & 0xFFFF_FFFF, 4)
    return int.from_bytes(data, "little") if len(data) == 4 else None


def _unwind(
    symbols: Symbols, state: dict[int, int], read: Read, place: int, *, newest: bool
) -> str | None:
    """Change ``state`` to the caller's frame; returns a note, None at the end of the stack."""
    before = state[PC], state[SP]
    note = ""
    rules = _rules(symbols, place)
    if rules is not None:
        if not _apply(rules, state, read):
            return None
    elif newest and symbols.function_at(state[LR] & ~1):
        state[PC] = state[LR]
    else:
        if not _scan(symbols, state, read):
            return None
        note = "by stack scan"
    if state[PC] in EXC_RETURNS:
        note = INTERRUPTED
        if not _pop_exception(state, read):
            return None
    state[PC] &= ~1
    return None if (state[PC], state[SP]) == before or not state[PC] else note


def _rules(symbols: Symbols, address: int) -> dict[Any, Any] | None:
    """Row of the unwind table (DWARF 4, 6.4.1) for an address."""
    for start, end, record in symbols.frames:
        if start <= address < end:
            rows = [row for row in record.get_decoded().table if row["pc"] <= address]
            return rows[-1] if rows else None
    return None


def _apply(rules: Mapping[Any, Any], state: dict[int, int], read: Read) -> bool:
    cfa_rule = rules["cfa"]
    if cfa_rule.reg is None:
        return False
    cfa = state.get(cfa_rule.reg, 0) + cfa_rule.offset & 0xFFFF_FFFF
    found: dict[int, int] = {}
    for number, rule in rules.items():
        if isinstance(number, int) and rule.type == "OFFSET":
            value = _word(read, cfa + rule.arg)
            if value is None:
                return False
            found[number] = value
        elif number == LR and rule.type == "UNDEFINED":
            return False  # the outermost frame
    state |= found
    state[PC], state[SP] = state[LR], cfa
    return True


def _scan(symbols: Symbols, state: dict[int, int], read: Read) -> bool:
    """Find the next word on the stack that points to the instruction after a call."""
    stack = read(state[SP], 4 * SCANNED_WORDS)
    for index in range(len(stack) // 4):
        word = int.from_bytes(stack[4 * index : 4 * index + 4], "little")
        if word & 1 and symbols.function_at(word & ~1) and _after_call(word & ~1, read):
            state[SP] += 4 * (index + 1)
            state[PC] = state[LR] = word
            return True
    return False


def _after_call(address: int, read: Read) -> bool:
    """Whether a BL or BLX ends at ``address``: ARMv7-M ARM, A7.7.18 and A7.7.19."""
    code = read(address - 4, 4)
    if len(code) < 4:
        return False
    first, second = int.from_bytes(code[:2], "little"), int.from_bytes(code[2:], "little")
    return second & 0xFF87 == 0x4780 or (first & 0xF800 == 0xF000 and second & 0xD000 == 0xD000)


def _pop_exception(state: dict[int, int], read: Read) -> bool:
    """Restore the registers from the exception frame."""
    if state[PC] & 4 and PSP in state:  # EXC_RETURN: to the process stack
        state[SP] = state[PSP]
    words = [_word(read, state[SP] + 4 * index) for index in range(FRAME_WORDS)]
    if None in words:
        return False
    r0, r1, r2, r3, r12, lr, pc, psr = (word or 0 for word in words)
    state |= {0: r0, 1: r1, 2: r2, 3: r3, 12: r12, LR: lr, PC: pc}
    state[SP] += 4 * FRAME_WORDS + (4 if psr & PSR_ALIGNED else 0)
    return True

"""Random programs: slices of code with forward branches only."""

from dataclasses import dataclass, field
from random import Random

from .encodings import ENCODINGS, Encoding, Fields

END = 0x2000
"""End of every slice, in flash. Literals are loaded from addresses on both sides of it."""

RAM = 0x2000_0000
RAM_BYTES = 0x4000
_LOW, _HIGH = 0x1400, 0x2700  # range of pointers with which all accesses are in RAM

INTERESTING = (0, 1, 2, 0x7F, 0x80, 0xFF, 0x100, 0x7FFF, 0x8000, 0xFFFF, 0x10000, 0x7FFFFFFF,
               0x80000000, 0x80000001, 0xFFFF8000, 0xFFFFFF80, 0xFFFFFFFE, 0xFFFFFFFF)  # fmt: skip

_NAMES = {"d", "n", "m", "a", "e", "p", "q", "x"}


def _parse(template: str) -> tuple[int, tuple[tuple[str, int], ...]]:
    """Width of an encoding, and its tokens with their widths, which are negative for fixed bits."""
    tokens: list[tuple[str, int]] = []
    for token in template.split():
        if set(token) <= {"0", "1"}:
            tokens.append((token, -len(token)))
        elif ":" in token:
            name, width = token.split(":")
            tokens.append((name, int(width)))
        elif token[0] in _NAMES and token[1:] in ("", "l"):
            tokens.append((token, 4 if len(token) == 1 else 3))
        elif token[1:] == "H":
            tokens.append((token, 1))
        else:
            tokens.append((token, 3))
    return sum(abs(width) for _, width in tokens), tuple(tokens)


_PARSED = {encoding.name: _parse(encoding.template) for encoding in ENCODINGS}
for _name, (_width, _) in _PARSED.items():
    assert _width in (16, 32), (_name, _width)


@dataclass
class Slice:
    """A slice."""

    start: int  #: address of its first instruction
    code: list[int]  #: its half-words; it ends at ``END``
    #: r0 to r12, SP, LR, process SP, flags (bits 31 to 27) at its start
    registers: list[int]
    classes: list[str]  #: names of the encodings in it


@dataclass
class _Item:
    """Half-words that are executed from the first on; ``target`` of a branch: index of an item."""

    halves: list[int]
    kind: str = ""
    target: int = 0
    register: int = 0
    condition: int = 0
    extra: list[int] = field(default_factory=list)


_BRANCHES = {"B T1": 1, "B T2": 1, "B T3": 2, "B T4": 2, "CBZ": 1, "CBNZ": 1, "BL": 2, "BX": 3,
             "BLX": 3, "MOV PC": 3, "ADD PC": 3, "LDR PC": 6, "POP PC": 4, "LDM PC": 6, "TBB": 5,
             "TBH": 6, "IT B": 2}  # fmt: skip
"""Half-words of each kind of branch, with what prepares it."""


def wide(value: int) -> list[int]:
    """The half-words of a 32-bit instruction."""
    return [value >> 16, value & 0xFFFF]


def movw(register: int, value: int) -> list[int]:
    """MOVW T3."""
    return wide(0xF2400000 | (value >> 11 & 1) << 26 | (value >> 12) << 16 | (value >> 8 & 7) << 12
                | register << 8 | (value & 0xFF))  # fmt: skip


class Generator:
    """Makes slices."""

    def __init__(self, seed: int) -> None:
        self.random = Random(seed)

    def slice(self, length: int) -> Slice:
        """Make a slice of about ``length`` instructions."""
        random = self.random
        self.pointers = random.sample(range(8), 2) + random.sample(range(8, 13), 1)
        self.aligned = self.word_pointer = self.pointers[random.randrange(3)]
        low = [r for r in range(8) if r not in self.pointers]
        self.index = random.choice(low)
        self.free = [r for r in (*range(13), 14) if r not in (*self.pointers, self.index)]
        self.free_low = [r for r in self.free if r < 8]
        self.sources = [*range(13), 14]
        self.offset = dict.fromkeys(self.pointers, 0)
        self.stack_valid = True
        self.classes: list[str] = []
        items: list[_Item] = []
        while len(self.classes) < length:
            items.append(self._item(len(items)))
        return Slice(*self._layout(items), self._registers(), self.classes)

    def _registers(self) -> list[int]:
        random = self.random
        values = [
            random.choice(INTERESTING) if random.random() < 0.4 else random.getrandbits(32)
            for _ in range(15)
        ]
        for r in self.pointers:
            values[r] = RAM + random.randrange(_LOW, _HIGH)
        values[self.word_pointer] &= ~3
        values[self.index] = random.randrange(256)
        values[13] = (RAM + random.randrange(_LOW, _HIGH)) & ~3
        return [*values, (RAM + random.randrange(_LOW, _HIGH)) & ~3, random.getrandbits(5) << 27]

    def _item(self, number: int) -> _Item:
        chance = self.random.random()
        if chance < 0.78:
            return _Item(self.plain())
        if chance < 0.86:
            return self._it_block()
        if chance < 0.94:
            return self._branch(number)
        return self._special()

    def plain(self, in_it: bool = False, tries: int = 100) -> list[int]:
        """One instruction of a random class."""
        while True:
            encoding = self.random.choice(ENCODINGS)
            if in_it and not encoding.in_it:
                continue
            found = self.one(encoding)
            if found is not None:
                self.classes.append(encoding.name)
                return found

    def one(self, encoding: Encoding) -> list[int] | None:
        """An instruction of a class, or None if the registers do not allow one."""
        width, tokens = _PARSED[encoding.name]
        if " SP T2" in encoding.name and not self.stack_valid:
            return None
        for _ in range(20):
            fields: Fields = {}
            value = 0
            for name, bits in tokens:
                if bits < 0:
                    value = value << -bits | int(name, 2)
                    continue
                content = self._field(name, bits, fields)
                if content is None:
                    return None
                value = value << bits | content
            if encoding.valid is None or encoding.valid(fields):
                break
        else:
            return None
        if encoding.moves:
            pointer = fields["p"]
            if self.offset[pointer] + encoding.moves > 2040:
                return None
            self.offset[pointer] += encoding.moves
            if pointer == self.aligned and encoding.moves == 255:
                self.aligned = -1
        return [value] if width == 16 else wide(value)

    def _field(self, name: str, bits: int, fields: Fields) -> int | None:
        random = self.random
        kind = name[0]
        if name in fields:
            return fields[name]
        if kind not in _NAMES or (len(name) > 1 and name[1] not in "lHL"):
            fields[name] = random.getrandbits(bits)
            return fields[name]
        if kind in fields:  # the same register again, or its low part
            register = fields[kind]
        elif kind in "de":
            register = random.choice(self.free_low if name[1:] == "l" else self.free)
        elif kind in "nma":
            register = random.randrange(8) if name[1:] == "l" else random.choice(self.sources)
        elif kind == "p":
            choices = [r for r in self.pointers if r < 8 or name != "pl"]
            register = random.choice(choices)
        elif kind == "q":
            if self.aligned < 0:
                return None
            register = self.aligned
            fields["p"] = register
        else:
            register = self.index
        fields[kind] = register
        if name[1:] == "H":
            return register >> 3
        return register & (7 if name[1:] in ("l", "L") else 15)

    def _it_block(self) -> _Item:
        random = self.random
        condition = random.randrange(15)
        length = random.randint(1, 4)
        mask = 0
        for _ in range(length - 1):
            other = 0 if condition == 14 else random.getrandbits(1)
            mask = mask << 1 | (condition & 1) ^ other
        mask = (mask << 1 | 1) << (4 - length)
        self.classes.append("IT")
        halves = [0xBF00 | condition << 4 | mask]
        # Without write-back, which would depend on the flags.
        before = dict(self.offset)
        for _ in range(length):
            while True:
                chosen = random.choice(ENCODINGS)
                if chosen.in_it and not chosen.moves:
                    found = self.one(chosen)
                    if found is not None:
                        break
            self.classes.append(chosen.name)
            halves += found
        self.offset = before
        return _Item(halves)

    def _branch(self, number: int) -> _Item:
        random = self.random
        kind = random.choice(list(_BRANCHES))
        if kind == "POP PC" and not self.stack_valid:
            kind = "BX"
        if kind in ("LDM PC", "LDR PC") and self.aligned < 0:
            kind = "BL"
        self.classes.append(kind)
        low = kind in ("CBZ", "CBNZ", "TBB", "TBH", "POP PC")
        item = _Item([], kind, number + random.randint(1, 12), condition=random.randrange(14))
        item.register = random.choice(self.free_low if low else [r for r in self.free if r != 14])
        item.extra = [self.aligned]
        item.halves = [0] * _BRANCHES[kind]
        return item

    def _special(self) -> _Item:
        random = self.random
        kind = random.choice(["PUSH", "POP", "STM T1", "LDM T1", "STM.W", "LDM.W", "STMDB", "LDMDB",
                              "ADD SP T2", "SUB SP", "ADD SP imm T3", "ADD SP reg", "MOV SP",
                              "LDR SP", "LDREX", "LDREXB", "CONTROL", "MSR PSP"])  # fmt: skip
        halves = self._accesses(kind)
        if not halves:
            return _Item(self.plain())
        self.classes.append(kind)
        return _Item(halves)

    def _accesses(self, kind: str) -> list[int]:
        random = self.random
        pointer = self.aligned
        if kind in ("PUSH", "POP"):
            if not self.stack_valid:
                return []
            if kind == "PUSH":
                return [0xB400 | random.randrange(1, 512)]
            registers = self._list(self.free_low)
            return [0xBC00 | registers] if registers else []
        if kind in ("STM T1", "LDM T1"):
            if not 0 <= pointer < 8 or self.offset[pointer] > 1000:
                return []
            self.offset[pointer] += 32
            if kind == "STM T1":
                registers = random.randrange(1, 256)
                if registers >> pointer & 1 and registers & ((1 << pointer) - 1):
                    registers &= ~(1 << pointer)  # its stored value is UNKNOWN
                return [0xC000 | pointer << 8 | registers] if registers else []
            registers = self._list(self.free_low)
            return [0xC800 | pointer << 8 | registers] if registers else []
        if kind in ("STM.W", "LDM.W", "STMDB", "LDMDB"):
            if pointer < 0 or self.offset[pointer] > 1000:
                return []
            self.offset[pointer] += 64
            load = kind.startswith("LDM")
            registers = self._list(self.free if load else [r for r in (*range(13), 14)
                                                           if r != pointer])  # fmt: skip
            if registers.bit_count() < 2:
                return []
            base = 0xE9000000 if kind.endswith("DB") else 0xE8800000
            return wide(base | load << 20 | random.getrandbits(1) << 21 | pointer << 16 | registers)
        if kind.startswith("LDREX"):  # with the STREX for which QEMU's monitor agrees
            if pointer < 0:
                return []
            d, e, t = random.sample(self.free, 3)
            if kind == "LDREX":
                return [*wide(0xE8500F00 | pointer << 16 | d << 12 | 2),
                        *wide(0xE8400000 | pointer << 16 | t << 12 | e << 8 | 2)]  # fmt: skip
            half = random.getrandbits(1)
            return [*wide(0xE8D00F4F | half << 4 | pointer << 16 | d << 12),
                    *wide(0xE8C00F40 | half << 4 | pointer << 16 | t << 12 | e)]  # fmt: skip
        if not self.stack_valid:
            return []
        if kind == "CONTROL":  # to either stack
            d = random.choice(self.free_low)
            return [0x2000 | d << 8 | random.choice([0, 2]), *wide(0xF3808814 | d << 16),
                    *wide(0xF3BF8F6F)]  # fmt: skip
        # QEMU keeps the two low bits that are written to SP; by B1.4.1 they are 0 (test_core.py).
        self.stack_valid = False
        word, pointer = self.free[0], self.pointers[0]
        masked = wide(0xF0200003 | random.choice(self.sources) << 16 | word << 8)  # BIC word, s, 3
        flags = random.getrandbits(1) << 20
        return {
            "ADD SP T2": [0xB000 | random.getrandbits(7)],
            "SUB SP": [0xB080 | random.getrandbits(7)],
            "ADD SP imm T3": wide(random.choice([0xF10D0D00, 0xF1AD0D00]) | flags
                                  | random.randrange(1, 64) << 2),
            "ADD SP reg": wide(random.choice([0xEB0D0D80, 0xEBAD0D80, 0xEB0D0DC0]) | flags
                               | random.choice(self.sources)),
            "MOV SP": [*masked, 0x4685 | word << 3],
            "LDR SP": [*masked, *wide(0xF8C00000 | pointer << 16 | word << 12),
                       *wide(0xF8D0D000 | pointer << 16)],
            "MSR PSP": [*masked, *wide(0xF3808809 | word << 16)],
        }[kind]  # fmt: skip

    def _list(self, registers: list[int]) -> int:
        return sum(1 << r for r in registers if self.random.getrandbits(1))

    # Addresses

    def _layout(self, items: list[_Item]) -> tuple[int, list[int]]:
        sizes = [2 * len(item.halves) for item in items]
        start = END - sum(sizes)
        places = [start]
        for size in sizes:
            places.append(places[-1] + size)
        code: list[int] = []
        for number, item in enumerate(items):
            if item.kind:
                target = places[min(item.target, len(items))]
                item.halves = self._resolve(item, places[number], target, len(item.halves))
            code += item.halves
        return start, code

    def _resolve(self, item: _Item, at: int, target: int, size: int) -> list[int]:
        r, distance = item.register, target - at - 4
        if item.kind in ("B T1", "CBZ", "CBNZ") and (distance < 0 or distance > 126):
            return [0xBF00]
        match item.kind:
            case "B T1":
                return [0xD000 | item.condition << 8 | distance >> 1 & 0xFF]
            case "B T2":
                return [0xE000 | distance >> 1 & 0x7FF]
            case "B T3":
                return wide(0xF0008000 | (distance < 0) << 26 | item.condition << 22
                            | (distance >> 12 & 0x3F) << 16 | (distance < 0) << 13
                            | (distance < 0) << 11 | distance >> 1 & 0x7FF)  # fmt: skip
            case "B T4" | "BL":
                base = 0xF000B800 if item.kind == "B T4" else 0xF000F800
                return wide(base | (distance < 0) << 26 | (distance >> 12 & 0x3FF) << 16
                            | distance >> 1 & 0x7FF)  # fmt: skip
            case "CBZ" | "CBNZ":
                base = 0xB100 if item.kind == "CBZ" else 0xB900
                return [base | (distance >> 6 & 1) << 9 | (distance >> 1 & 31) << 3 | r]
            case "BX" | "BLX":
                return [*movw(r, target | 1), (0x4700 if item.kind == "BX" else 0x4780) | r << 3]
            case "MOV PC":
                return [*movw(r, target | self.random.getrandbits(1)), 0x4687 | r << 3]
            case "ADD PC":
                if target < at + 8:
                    return [*movw(r, 0), 0xBF00]
                return [*movw(r, target - at - 8), 0x4487 | r << 3]
            case "LDR PC" | "LDM PC":
                store, load = ((0xF8C00008, 0xF8D0F008) if item.kind == "LDR PC"
                               else (0xF8C00004, 0xE8908000 | 1 << r))  # fmt: skip
                pointer = item.extra[0] << 16
                return [*movw(r, target | 1), *wide(store | pointer | r << 12),
                        *wide(load | pointer)]  # fmt: skip
            case "POP PC":
                return [*movw(r, target | 1), 0xB400 | 1 << r, 0xBD00]
            case "TBB" | "TBH":
                chosen = self.random.getrandbits(1)
                entry = (target - (at + 6)) >> 1
                least = size - 3  # half-words of the table
                entries = [least, least]
                entries[chosen] = max(entry, least)
                head = [0x2000 | r << 8 | chosen, *wide(0xE8DFF000 | r)]
                if item.kind == "TBB":
                    return [*head, entries[0] | entries[1] << 8, 0xBF00]
                return [*head[:2], head[2] | 0x10, *entries, 0xBF00]
            case _:  # IT B: a branch as last instruction of a block
                return [0xBF08 | item.condition << 4, 0xE000 | (distance - 2) >> 1 & 0x7FF]

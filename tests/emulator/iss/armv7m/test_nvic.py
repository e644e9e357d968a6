"""Priorities: random sequences against an independent statement of the rules (B1.5.4, B3.4)."""

import random

from tests.together import together

from .bench import SYSTEM, Bench

NMI, PEND_SV, SYSTICK, FIRST = 2, 14, 15, 16
ISER, ICER, ISPR, ICPR, IABR, IPR = (
    SYSTEM[name] for name in ("ISER", "ICER", "ISPR", "ICPR", "IABR", "IPR")
)
SEEDS = 20


class Rules:
    """The rules, on sets of exceptions instead of bits."""

    def __init__(self, bits: int) -> None:
        self.bits = bits
        self.enabled = {NMI, PEND_SV, SYSTICK}
        self.pending: set[int] = set()
        self.high: set[int] = set()
        self.priority = dict.fromkeys(range(FIRST, FIRST + 39), 0)
        self.priority |= {NMI: -2, PEND_SV: 0, SYSTICK: 0}
        self.group = 0
        self.base = 0
        self.masked = self.fault_masked = False
        self.nested: list[int] = []

    def preempting(self, priority: int) -> int:
        """Group of a priority."""
        if priority < 0:
            return priority
        step = 2 ** (self.group + 1)
        return priority // step * step

    def running(self) -> int:
        """The execution priority."""
        candidates = [256, *(self.preempting(self.priority[each]) for each in self.nested)]
        if self.base:
            candidates.append(self.preempting(self.base))
        if self.masked:
            candidates.append(0)
        if self.fault_masked:
            candidates.append(-1)
        return min(candidates)

    def first(self) -> int:
        """The next pending exception; 0: none."""
        ready = self.pending & self.enabled
        return min(ready, key=lambda each: (self.priority[each], each), default=0)

    def take(self) -> None:
        """Enter the next exception if its priority allows."""
        number = self.first()
        if number and self.preempting(self.priority[number]) < self.running():
            self.pending.discard(number)
            self.nested.append(number)

    def leave(self) -> None:
        """Return from the handler; another may be tail-chained."""
        number = self.nested.pop()
        if number != NMI:
            self.fault_masked = False
        if number in self.high:
            self.pending.add(number)
        self.take()

    def line(self, number: int, level: bool) -> None:
        if level and number not in self.high:
            self.pending.add(number)
        (self.high.add if level else self.high.discard)(number)


def one_action(chance: random.Random, bench: Bench, rules: Rules) -> None:
    """Do the same on both."""
    kind = chance.choice(
        ["line"] * 3
        + ["pend"] * 3
        + ["enable", "disable", "unpend", "priority", "group", "base", "mask", "fault", "system"]
        + ["service"] * 4
        + ["return"] * 5
    )
    interrupt = chance.randrange(39)
    number = FIRST + interrupt
    word, bit = interrupt // 32 * 4, 1 << interrupt % 32
    if kind == "line":
        level = chance.random() < 0.5
        bench.line(interrupt, level)
        rules.line(number, level)
    elif kind == "pend":
        if chance.random() < 0.5:
            bench.write(ISPR + word, bit)
        else:
            bench["STIR"] = interrupt
        rules.pending.add(number)
    elif kind == "enable":
        bench.write(ISER + word, bit | 1)
        rules.enabled |= {number, FIRST + word * 8}
    elif kind == "disable":
        bench.write(ICER + word, bit)
        rules.enabled.discard(number)
    elif kind == "unpend":
        bench.write(ICPR + word, bit)
        if number not in rules.high or number in rules.nested:
            rules.pending.discard(number)
    elif kind == "priority":
        value = chance.randrange(256)
        bench.write(IPR + interrupt, value, 1)
        if number not in rules.nested:
            rules.priority[number] = value >> (8 - rules.bits) << (8 - rules.bits)
        else:  # an active exception keeps its priority: the nesting must stay consistent
            bench.write(IPR + interrupt, rules.priority[number], 1)
    elif kind == "group":
        if not rules.nested:
            rules.group = chance.randrange(8)
            bench["AIRCR"] = 0x05FA0000 | rules.group << 8
            bench["AIRCR"] = 0x12340000  # ignored without the key
    elif kind == "base":
        rules.base = chance.choice([0, 0, chance.randrange(256)])
        rules.base = rules.base >> (8 - rules.bits) << (8 - rules.bits)
        bench["basepri"] = rules.base
    elif kind == "mask":
        rules.masked = chance.random() < 0.3
        bench["primask"] = rules.masked
    elif kind == "fault":
        if rules.running() > -1:
            rules.fault_masked = chance.random() < 0.3
            bench["faultmask"] = rules.fault_masked
    elif kind == "system":
        number = chance.choice([NMI, PEND_SV, SYSTICK])
        bench["ICSR"] = 1 << {NMI: 31, PEND_SV: 28, SYSTICK: 26}[number]
        rules.pending.add(number)
        if not rules.nested:
            rules.priority[PEND_SV] = chance.randrange(256) >> (8 - rules.bits) << (8 - rules.bits)
            bench["SHPR3"] = rules.priority[PEND_SV] << 16
    elif kind == "service":
        bench.service()
        rules.take()
    elif rules.nested:
        bench.exception_return(bench["lr"])
        rules.leave()


@together("seed", range(SEEDS))
def test_nvic_follows_the_reference_rules_for_random_sequences(seed):
    chance = random.Random(seed)
    bits = chance.choice([3, 3, 4, 8])
    bench, rules = Bench(priority_bits=bits), Rules(bits)
    for number in range(39):
        if chance.random() < 0.7:
            bench.write(ISER + number // 32 * 4, 1 << number % 32)
            rules.enabled.add(FIRST + number)
    for _ in range(400):
        one_action(chance, bench, rules)
        assert bench.ipsr == (rules.nested[-1] if rules.nested else 0)
        running = bench["priority"]
        assert running - (1 << 32) * (running >> 31) == rules.running()
        assert bench["ICSR"] >> 12 & 0x1FF == rules.first()
        pending = bench.read(ISPR) | bench.read(ISPR + 4) << 32
        assert pending == sum(1 << each - FIRST for each in rules.pending if each >= FIRST)
        active = bench.read(IABR) | bench.read(IABR + 4) << 32
        assert active == sum(1 << each - FIRST for each in rules.nested if each >= FIRST)
    assert not bench["locked"]


def test_registers_of_unimplemented_interrupts_read_zero():
    bench = Bench()
    for address in (ISER, ISER + 4, ISER + 8, ISPR + 4):
        bench.write(address, 0xFFFFFFFF)
    assert (bench.read(ISER), bench.read(ISER + 4), bench.read(ISER + 8)) == (0xFFFFFFFF, 0x7F, 0)
    assert (bench.read(ICER), bench.read(ISPR + 4)) == (0xFFFFFFFF, 0x7F)
    bench.write(IPR + 36, 0xFFFFFFFF)
    bench.write(IPR + 40, 0xFFFFFFFF)
    assert (bench.read(IPR + 36), bench.read(IPR + 40)) == (0x00E0E0E0, 0)
    assert bench.read(IPR + 37, 1) == 0xE0
    assert bench.read(0xE000E004) == 1  # ICTR

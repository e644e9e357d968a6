"""Behaviour that the comparison with unicorn leaves out, or that unicorn does not have.

Faults, bit-bands, changed code, breakpoints, watchpoints and the time at which a run ends.
"""

from collections.abc import Callable
from pathlib import Path

import pytest

from cubestack.emulator.iss.machine import Machine
from cubestack.emulator.iss.outcome import StopReason, Watch
from cubestack.emulator.native.compiler import find_compiler
from tests.emulator.iss.cross_compiler import binary_of, compile_for_m3, needs_compiler

CODE = 0x100
DATA = 0x2000_0100
FAR = 1 << 60
CFSR, CCR, SHCSR, BFAR = 0xE000_ED28, 0xE000_ED14, 0xE000_ED24, 0xE000_ED38
HANDLER = 0x80

UNDEFINED, INVALID_STATE, NO_COPROCESSOR = 1 << 16, 1 << 17, 1 << 19
UNALIGNED, DIVIDE_BY_ZERO = 1 << 24, 1 << 25
PRECISE, IMPRECISE, FETCH_VIOLATION, FETCH_BUS = 1 << 9, 1 << 10, 1 << 0, 1 << 8

pytestmark = [
    needs_compiler,
    pytest.mark.skipif(find_compiler() is None, reason="needs a C++ compiler"),
]

Load = Callable[..., Machine]


def assemble(text: str, folder: Path) -> bytes:
    source, built = folder / "code.s", folder / "code.o"
    source.write_text(f".syntax unified\n{text}\n")
    compile_for_m3("-c", source, "-o", built)
    return binary_of(built)


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Makes a machine whose next instruction is the first of a text; every fault ends in a loop."""

    def make(text: str, at: int = CODE, part: bool = False, **registers: int) -> Machine:
        machine = Machine(bare_hz=None if part else 1_000_000)
        vectors = [0x2001_0000] + [HANDLER | 1] * 15
        machine.poke(0, b"".join(word.to_bytes(4, "little") for word in vectors))
        machine.poke(HANDLER, b"\xfe\xe7")
        machine.poke(at, assemble(text, tmp_path))
        machine.reset()
        if part:  # starts up after its reset
            run_to(machine, 200_000_000)
        machine.write(SHCSR, 7 << 16)
        for name, value in registers.items():
            machine.set_register(name, value)
        machine.set_register("pc", at)
        return machine

    return make


def run_to(machine: Machine, until_ps: int) -> int:
    """Run to a time, continuing at breakpoints; returns their number."""
    stops = 0
    while machine.now_ps < until_ps:
        stops += machine.run(until_ps).reason == StopReason.BREAKPOINT
        list(machine.outbox())
    return stops


def steps(machine: Machine, count: int) -> Machine:
    for _ in range(count):
        machine.step()
    return machine


def registers(machine: Machine, names: str) -> list[int]:
    return [machine.register(name) for name in names.split()]


def word(machine: Machine, address: int) -> int:
    return int.from_bytes(machine.peek(address, 4), "little")


def state(machine: Machine) -> tuple[dict[str, int], int, int]:
    return machine.registers(), machine.cycles, machine.instructions


def status(machine: Machine) -> int:
    return word(machine, CFSR)


@pytest.mark.parametrize(
    ("text", "bits"),
    [
        ("udf #1", UNDEFINED),
        ("udf.w #1", UNDEFINED),
        (".inst.w 0xfb80a001  @ SMULL, defined\n.inst.w 0xfa81f080  @ QADD: DSP", UNDEFINED),
        (".inst.w 0xfba00060  @ UMAAL: DSP", UNDEFINED),
        (".inst.w 0xf3200000  @ SSAT16: DSP", UNDEFINED),
        ("mcr p10, 0, r0, c0, c0, 0", NO_COPROCESSOR),
        (".inst.w 0xee000a10  @ VMOV: no FPU", NO_COPROCESSOR),
        ("ldc p1, c0, [r0]", NO_COPROCESSOR),
        ("movs r0, #0\n bx r0", INVALID_STATE),
        ("ldr r0, [r1]\n blx r0", INVALID_STATE),
        ("push {r0}\n pop {pc}", INVALID_STATE),
        ("movs r1, #1\n ldm r1, {r2, r3}", UNALIGNED),
        ("ldr r1, =0x20000102\n ldrd r2, r3, [r1]", UNALIGNED),
        ("ldr r1, =0x20000102\n ldrex r2, [r1]", UNALIGNED),
        ("ldr r1, =0x20000102\n stmdb r1!, {r2, r3}", UNALIGNED),
        ("ldr r1, =0x70000000\n ldr r0, [r1]", PRECISE),
        ("ldr r1, =0x70000000\n ldmia r1, {r2-r5}", PRECISE),
        ("ldr r1, =0x70000000\n str r0, [r1]\n nop\n nop", IMPRECISE),
        ("ldr r1, =0x70000001\n bx r1", FETCH_BUS),
        ("ldr r1, =0x40000001\n bx r1", FETCH_VIOLATION),
        ("ldr r1, =0xe000e001\n bx r1", FETCH_VIOLATION),
    ],
)  # fmt: skip
def test_fault_sets_its_status_bit_and_enters_the_handler(load: Load, text: str, bits: int) -> None:
    machine = load(text, r0=0, r1=DATA)
    for _ in range(6):
        if status(machine):
            break
        machine.step()
    assert status(machine) & ~(1 << 15 | 1 << 7) == bits
    assert machine.run(machine.now_ps + 100_000_000).reason == StopReason.TIME
    assert machine.register("pc") == HANDLER


@pytest.mark.parametrize(
    ("trap", "count", "cause"), [(0, 4, 0), (1 << 3, 1, UNALIGNED), (1 << 4, 2, DIVIDE_BY_ZERO)]
)
def test_unaligned_accesses_and_divisions_by_zero_fault_only_if_trapped(
    load: Load, trap: int, count: int, cause: int
) -> None:
    text = "ldr r2, [r1]\n udiv r3, r2, r0\n ldrh r4, [r1, #2]\n sdiv r5, r2, r0"
    machine = load(text, r0=0, r1=DATA + 1, r3=9, r5=9)
    machine.write(CCR, trap)
    steps(machine, count)
    assert status(machine) == cause
    assert registers(machine, "r3 r5") == ([9, 9] if trap else [0, 0])


def test_failed_multiple_load_changes_no_register(load: Load) -> None:
    end_of_ram = 0x2002_0000  # where the third word would be
    start = end_of_ram - 8
    machine = steps(load("ldmia r1!, {r2-r5}", r1=start, r2=2, r3=3, r4=4, r5=5), 1)
    assert status(machine) & PRECISE
    assert registers(machine, "r1 r4 r5") == [start, 4, 5]
    assert word(machine, machine.register("sp") + 8) == 2  # stacked r2
    assert word(machine, BFAR) == end_of_ram


def test_it_state_is_stacked_with_a_fault(load: Load) -> None:
    machine = steps(load("it eq\n udfeq #0", xpsr=1 << 30 | 1 << 24), 2)
    stacked = word(machine, machine.register("sp") + 28)
    assert (stacked >> 8 & 0xFC) | (stacked >> 25 & 3) == 0x08  # EQ, its one instruction
    assert word(machine, machine.register("sp") + 24) == CODE + 2
    assert machine.register("xpsr") & 0x0600_FC00 == 0


def test_stack_pointers_are_word_aligned(load: Load) -> None:
    # B1.4.1: SP<1:0> are 0 whatever is written.
    text = (
        "mov sp, r0\n add sp, sp, r1\n sub.w sp, sp, #2\n"
        "msr psp, r0\n ldr sp, [r2]\n addw sp, sp, #3"
    )
    machine = load(text, r0=0x2000_0803, r1=6, r2=DATA)
    machine.write(DATA, 0x2000_0407)
    found = [steps(machine, 1).register("sp") & 0xFFF for _ in range(6)]
    assert found == [0x800, 0x804, 0x800, 0x800, 0x404, 0x404]
    assert machine.register("psp") == 0x2000_0800


def test_basepri_has_the_bits_of_the_part(load: Load) -> None:
    text = "msr basepri, r0\n mrs r1, basepri\n msr basepri_max, r2\n mrs r3, basepri\n"
    machine = load(text + "msr basepri_max, r4\n mrs r5, basepri", r0=0x7F, r2=0xA0, r4=0x45)
    assert registers(steps(machine, 6), "r1 r3 r5") == [0x60, 0x60, 0x40]


def test_unprivileged_code_changes_no_masks(load: Load) -> None:
    text = (
        "msr control, r0\n isb\n cpsid if\n msr primask, r0\n mrs r1, primask\n"
        "msr control, r2\n mrs r3, control"
    )
    machine = load(text, r0=1, r1=9, r2=0)
    assert registers(steps(machine, 7), "r1 primask r3") == [0, 0, 1]


def test_bit_band_alias_is_one_bit_of_the_ram(load: Load) -> None:
    # Bit 5 of the byte at DATA + 3: alias 0x22000000 + 32 * offset + 4 * bit (TRM 4.3).
    alias = 0x2200_0000 + 32 * (DATA + 3 - 0x2000_0000) + 4 * 5
    machine = load("ldr r3, [r0]\n str r1, [r0]\n ldr r4, [r0]\n strb r2, [r0]\n ldrb r5, [r0]",
                   r0=alias, r1=0xFFFF_FFFF, r2=2)  # fmt: skip
    machine.write(DATA, 0x0180_0042)
    assert word(steps(machine, 3), DATA) == 0x2180_0042
    assert word(steps(machine, 2), DATA) == 0x0180_0042
    assert registers(machine, "r3 r4 r5") == [0, 1, 0]


def test_exclusive_store_needs_an_exclusive_load_before(load: Load) -> None:
    text = ("strex r0, r1, [r2]\n ldrex r3, [r2]\n clrex\n strex r4, r1, [r2]\n"
            "ldrexb r3, [r2]\n strexb r5, r1, [r2]\n strexh r6, r1, [r2]")  # fmt: skip
    machine = steps(load(text, r1=0x1234, r2=DATA), 7)
    assert registers(machine, "r0 r4 r5 r6") == [1, 1, 0, 1]
    assert word(machine, DATA) == 0x34


@pytest.mark.parametrize("at", [CODE, 0x2000_0200])
def test_code_changed_by_a_debugger_is_decoded_again(load: Load, at: int) -> None:
    text = "1: adds r0, #1\n cmp r0, #3\n bne 1b\n 2: b 2b"
    machine = load(text, at=at, r0=0)
    machine.run(20_000_000)
    assert machine.register("r0") == 3
    machine.poke(at, b"\x02\x30")  # adds r0, #2
    machine.set_register("r0", 1)
    machine.set_register("pc", at)
    machine.run(machine.now_ps + 20_000_000)
    assert registers(machine, "r0 pc") == [3, at + 6]


def test_code_that_changes_itself_runs_as_changed(load: Load) -> None:
    # Each round increments the constant of the MOV before it is executed again.
    text = ("1: movs r0, #0\n ldrh r1, [r2]\n adds r1, #1\n strh r1, [r2]\n subs r3, #1\n bne 1b\n"
            "2: b 2b")  # fmt: skip
    machine = load(text, at=0x2000_0200, r2=0x2000_0200, r3=10)
    machine.run(1_000_000_000)
    assert machine.register("r0") == 9


def test_long_instruction_in_place_of_a_short_one_is_decoded(load: Load) -> None:
    machine = load("nop\n 1: b 1b\n nop", at=0x2000_0200)
    machine.run(10_000_000)
    machine.poke(0x2000_0202, bytes.fromhex("40f20520"))  # movw r0, #517
    machine.run(machine.now_ps + 1_000_000)
    assert machine.register("r0") == 517


def test_breakpoints_stop_before_their_instruction_and_take_no_time(load: Load) -> None:
    text = (
        "movs r1, #5\n 1: adds r0, r0, r1\n it eq\n moveq r2, #1\n subs r1, #1\n bne 1b\n 2: b 2b"
    )
    plain, broken = (load(text, r0=0) for _ in range(2))
    places = [CODE + 2, CODE + 4, CODE + 6]  # the second is an IT, the third in its block
    broken.breakpoints |= set(places)
    hits = []
    while broken.cycles < 60:
        stop = broken.run(60_000_000)
        if stop.reason == StopReason.BREAKPOINT:
            hits.append(broken.register("pc"))
    plain.run(60_000_000)
    assert hits == places * 5
    assert state(plain) == state(broken)


MIXED = """
    ldr r4, =0x20000100
    movs r6, #6
    .p2align 2
    nop
1:  add.w r5, r4, #8
    ldr r0, [r5]
    ldr r1, [r5, #4]
    str r1, [r4]
    bl 3f
    subs r6, #1
    ittt ne
    addne r7, r7, r0
    ldrne r2, [r7]
    bne 1b
2:  b 2b
    .p2align 2
    adds r4, #0  @ never executed; the next load seems to depend on it
3:  ldr.w r3, [r4, #12]
    movs r2, #5
    udiv r2, r0, r2
    bx lr
"""


@pytest.mark.parametrize("part", [False, True])  # without and with flash waits and cache
def test_breakpoints_everywhere_change_no_cycle(load: Load, part: bool) -> None:
    plain, broken = (load(MIXED, part=part, r7=DATA) for _ in range(2))
    end = plain.now_ps + (20_000_000 if part else 200_000_000)
    for address in range(CODE, CODE + 0x40, 2):
        broken.breakpoints.add(address)
    assert run_to(plain, end) == 0
    assert run_to(broken, end) > 50
    assert state(plain) == state(broken)


@pytest.mark.parametrize("part", [False, True])
def test_slices_and_steps_change_no_cycle(load: Load, part: bool) -> None:
    plain, sliced, stepped = (load(MIXED, part=part, r7=DATA) for _ in range(3))
    start, slice_ps = plain.now_ps, 100_000 if part else 1_000_000
    run_to(plain, start + 200 * slice_ps)
    for number in range(1, 201):
        run_to(sliced, start + number * slice_ps)
    while stepped.cycles < plain.cycles:
        stepped.step()
    assert state(plain) == state(sliced) == state(stepped)


def test_watchpoints_stop_before_the_instruction_that_accesses(load: Load) -> None:
    text = "ldr r0, [r1]\n strb r2, [r1, #3]\n str r2, [r1, #4]\n push {r0, r1}\n nop"
    machine = load(text, r1=DATA, r2=7, sp=DATA + 16)
    watches = Watch(DATA + 3, 1, "w"), Watch(DATA + 12, 4, "a")
    for watch in watches:
        machine.watch(watch)
    assert machine.run(FAR).reason == StopReason.WATCHPOINT
    hit = machine.watch_hit
    assert (hit.pc, hit.address, hit.size, hit.write) == (CODE + 2, DATA + 3, 1, True)
    assert machine.register("pc") == CODE + 2
    assert machine.peek(DATA + 3, 1) != b"\7"
    assert machine.run(FAR).reason == StopReason.WATCHPOINT
    assert machine.peek(DATA + 3, 1) == b"\7"
    assert (machine.watch_hit.address, machine.register("pc")) == (DATA + 12, CODE + 6)
    for watch in watches:
        machine.watch(watch, on=False)
    assert machine.run(machine.now_ps + 2_000_000).reason == StopReason.TIME


def test_run_ends_at_its_time(load: Load) -> None:
    machine = load("1: adds r0, #1\n adds r0, #1\n adds r0, #1\n b 1b", r0=0)
    for until in range(1, 200):
        machine.run(until * 1_000_000)
        assert until <= machine.cycles < until + 2


def test_fetch_beyond_the_memory_is_a_bus_fault(load: Load) -> None:
    machine = steps(load("nop\n nop", at=0x2001_FFFC), 3)
    assert status(machine) & FETCH_BUS
    machine = load("nop", at=0x2001_FFFC)  # then the first half of a 32-bit instruction
    machine.poke(0x2001_FFFE, bytes.fromhex("40f2"))
    steps(machine, 2)
    assert status(machine) & FETCH_BUS

"""What lockstep can not tell: faults, bit bands, SP's low bits, changed code, breakpoints."""

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from cubestack.emulator.iss.machine import Machine
from cubestack.emulator.iss.outcome import StopReason, Watch
from cubestack.emulator.native.compiler import find_compiler

ASSEMBLER = shutil.which("arm-none-eabi-gcc")
CODE = 0x100
DATA = 0x2000_0100
FAR = 1 << 60
CFSR, CCR, SHCSR = 0xE000_ED28, 0xE000_ED14, 0xE000_ED24
HANDLER = 0x80

UNDEFINED, INVALID_STATE, NO_COPROCESSOR = 1 << 16, 1 << 17, 1 << 19
UNALIGNED, DIVIDE_BY_ZERO = 1 << 24, 1 << 25
PRECISE, IMPRECISE, FETCH_VIOLATION, FETCH_BUS = 1 << 9, 1 << 10, 1 << 0, 1 << 8

pytestmark = [
    pytest.mark.skipif(ASSEMBLER is None, reason="needs arm-none-eabi-gcc"),
    pytest.mark.skipif(find_compiler() is None, reason="needs a C++ compiler"),
]

Load = Callable[..., Machine]


def assemble(text: str, folder: Path) -> bytes:
    source, built, plain = folder / "code.s", folder / "code.o", folder / "code.bin"
    source.write_text(f".syntax unified\n.cpu cortex-m3\n.thumb\n{text}\n")
    assert ASSEMBLER is not None
    subprocess.run([ASSEMBLER, "-mcpu=cortex-m3", "-c", source, "-o", built], check=True)
    copy = ASSEMBLER.replace("gcc", "objcopy")
    subprocess.run([copy, "-O", "binary", built, plain], check=True)
    return plain.read_bytes()


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Makes a machine about to run some lines at ``CODE``; all faults end in a loop."""

    def make(text: str, at: int = CODE, part: bool = False, **registers: int) -> Machine:
        machine = Machine(bare_hz=None if part else 1_000_000)
        vectors = [0x2001_0000] + [HANDLER | 1] * 15
        machine.poke(0, b"".join(word.to_bytes(4, "little") for word in vectors))
        machine.poke(HANDLER, b"\xfe\xe7")
        machine.poke(at, assemble(text, tmp_path))
        machine.reset()
        if part:  # it leaves its reset late
            run_to(machine, 200_000_000)
        machine.write(SHCSR, 7 << 16)
        for name, value in registers.items():
            machine.set_register(name, value)
        machine.set_register("pc", at)
        return machine

    return make


def run_to(machine: Machine, until_ps: int) -> int:
    """Run to a time, over breakpoints; how many there were."""
    stops = 0
    while machine.now_ps < until_ps:
        stops += machine.run(until_ps).reason == StopReason.BREAKPOINT
        list(machine.outbox())
    return stops


def steps(machine: Machine, count: int) -> None:
    for _ in range(count):
        machine.step()


def status(machine: Machine) -> int:
    return int.from_bytes(machine.peek(CFSR, 4), "little")


def word(machine: Machine, address: int) -> int:
    return int.from_bytes(machine.peek(address, 4), "little")


@pytest.mark.parametrize(
    ("text", "bits"),
    [
        ("udf #1", UNDEFINED),
        ("udf.w #1", UNDEFINED),
        (".inst.w 0xfb80a001  @ smull with SP-like fields is fine; the next is QADD\n"
         ".inst.w 0xfa81f080", UNDEFINED),
        (".inst.w 0xfba00060  @ UMAAL: DSP extension", UNDEFINED),
        (".inst.w 0xf3200000  @ SSAT16: DSP extension", UNDEFINED),
        ("mcr p10, 0, r0, c0, c0, 0", NO_COPROCESSOR),
        (".inst.w 0xee000a10  @ VMOV: there is no FPU", NO_COPROCESSOR),
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
def test_fault(load: Load, text: str, bits: int) -> None:
    machine = load(text, r0=0, r1=DATA)
    for _ in range(6):
        if status(machine):
            break
        machine.step()
    assert status(machine) & ~(1 << 15 | 1 << 7) == bits
    assert machine.run(machine.now_ps + 100_000_000).reason == StopReason.TIME
    assert machine.register("pc") == HANDLER


def test_traps_are_off_until_asked_for(load: Load) -> None:
    text = "ldr r2, [r1]\n udiv r3, r2, r0\n ldrh r4, [r1, #2]\n sdiv r5, r2, r0"
    machine = load(text, r0=0, r1=DATA + 1, r3=9, r5=9)
    steps(machine, 4)
    assert (machine.register("r3"), machine.register("r5"), status(machine)) == (0, 0, 0)
    machine = load(text, r0=0, r1=DATA + 1)
    machine.write(CCR, 1 << 3)
    machine.step()
    assert status(machine) == UNALIGNED
    machine = load(text, r0=0, r1=DATA + 1)
    machine.write(CCR, 1 << 4)
    steps(machine, 2)
    assert status(machine) == DIVIDE_BY_ZERO


def test_registers_are_as_before_after_a_failed_load(load: Load) -> None:
    # The third word lies behind the RAM.
    machine = load("ldmia r1!, {r2-r5}", r1=0x2001_FFF8, r2=2, r3=3, r4=4, r5=5)
    machine.step()
    assert status(machine) & PRECISE
    assert [machine.register(f"r{n}") for n in (1, 4, 5)] == [0x2001_FFF8, 4, 5]
    assert word(machine, machine.register("sp") + 8) == 2  # stacked r2
    assert word(machine, 0xE000_ED38) == 0x2002_0000  # BFAR


def test_it_state_is_stacked_with_a_fault(load: Load) -> None:
    machine = load("it eq\n udfeq #0", xpsr=1 << 30 | 1 << 24)
    steps(machine, 2)
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
    found = []
    for _ in range(6):
        machine.step()
        found.append(machine.register("sp"))
    assert found == [0x2000_0800, 0x2000_0804, 0x2000_0800, 0x2000_0800, 0x2000_0404, 0x2000_0404]
    assert machine.register("psp") == 0x2000_0800


def test_basepri_has_the_bits_of_the_part(load: Load) -> None:
    text = "msr basepri, r0\n mrs r1, basepri\n msr basepri_max, r2\n mrs r3, basepri\n"
    machine = load(text + "msr basepri_max, r4\n mrs r5, basepri", r0=0x7F, r2=0xA0, r4=0x45)
    steps(machine, 6)
    assert [machine.register(f"r{n}") for n in (1, 3, 5)] == [0x60, 0x60, 0x40]


def test_unprivileged_code_changes_no_masks(load: Load) -> None:
    text = (
        "msr control, r0\n isb\n cpsid if\n msr primask, r0\n mrs r1, primask\n"
        "msr control, r2\n mrs r3, control"
    )
    machine = load(text, r0=1, r1=9, r2=0)
    steps(machine, 7)
    assert (machine.register("r1"), machine.register("primask"), machine.register("r3")) == (
        0,
        0,
        1,
    )


def test_bit_bands(load: Load) -> None:
    # Bit 5 of the byte at DATA + 3: alias 0x22000000 + 32 * offset + 4 * bit (TRM 4.3).
    alias = 0x2200_0000 + 32 * (DATA + 3 - 0x2000_0000) + 4 * 5
    machine = load("ldr r3, [r0]\n str r1, [r0]\n ldr r4, [r0]\n strb r2, [r0]\n ldrb r5, [r0]",
                   r0=alias, r1=0xFFFF_FFFF, r2=2)  # fmt: skip
    machine.write(DATA, 0x0180_0042)
    steps(machine, 3)
    assert word(machine, DATA) == 0x2180_0042
    steps(machine, 2)
    assert word(machine, DATA) == 0x0180_0042
    assert [machine.register(f"r{n}") for n in (3, 4, 5)] == [0, 1, 0]


def test_exclusives(load: Load) -> None:
    text = ("strex r0, r1, [r2]\n ldrex r3, [r2]\n clrex\n strex r4, r1, [r2]\n"
            "ldrexb r3, [r2]\n strexb r5, r1, [r2]\n strexh r6, r1, [r2]")  # fmt: skip
    machine = load(text, r1=0x1234, r2=DATA)
    steps(machine, 7)
    assert [machine.register(f"r{n}") for n in (0, 4, 5, 6)] == [1, 1, 0, 1]
    assert word(machine, DATA) == 0x34


@pytest.mark.parametrize("at", [CODE, 0x2000_0200])
def test_changed_code_is_run(load: Load, at: int) -> None:
    text = "1: adds r0, #1\n cmp r0, #3\n bne 1b\n 2: b 2b"
    machine = load(text, at=at, r0=0)
    machine.run(20_000_000)
    assert machine.register("r0") == 3
    machine.poke(at, b"\x02\x30")  # adds r0, #2
    machine.set_register("r0", 1)
    machine.set_register("pc", at)
    machine.run(machine.now_ps + 20_000_000)
    assert machine.register("r0") == 3
    assert machine.register("pc") == at + 6


def test_code_that_changes_itself(load: Load) -> None:
    # Each round increments the constant of the MOV before it is executed again.
    text = ("1: movs r0, #0\n ldrh r1, [r2]\n adds r1, #1\n strh r1, [r2]\n subs r3, #1\n bne 1b\n"
            "2: b 2b")  # fmt: skip
    machine = load(text, at=0x2000_0200, r2=0x2000_0200, r3=10)
    machine.run(1_000_000_000)
    assert machine.register("r0") == 9


def test_a_long_instruction_behind_a_short_one_is_decoded_anew(load: Load) -> None:
    machine = load("nop\n 1: b 1b\n nop", at=0x2000_0200)
    machine.run(10_000_000)
    machine.poke(0x2000_0202, bytes.fromhex("40f20520"))  # movw r0, #517
    machine.run(machine.now_ps + 1_000_000)
    assert machine.register("r0") == 517


def test_breakpoints_stop_before_and_cost_nothing(load: Load) -> None:
    text = (
        "movs r1, #5\n 1: adds r0, r0, r1\n it eq\n moveq r2, #1\n subs r1, #1\n bne 1b\n 2: b 2b"
    )
    plain, broken = (load(text, r0=0) for _ in range(2))
    broken.breakpoints.add(CODE + 2)
    broken.breakpoints.add(CODE + 4)  # an IT that is folded
    broken.breakpoints.add(CODE + 6)  # within its block
    hits = []
    while broken.cycles < 60:
        stop = broken.run(60_000_000)
        if stop.reason == StopReason.BREAKPOINT:
            hits.append(broken.register("pc"))
    plain.run(60_000_000)
    assert hits == [CODE + 2, CODE + 4, CODE + 6] * 5
    assert plain.registers() == broken.registers()
    assert (plain.cycles, plain.instructions) == (broken.cycles, broken.instructions)


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
    adds r4, #0  @ never run, but the load behind it looks as if it had to wait for it
3:  ldr.w r3, [r4, #12]
    movs r2, #5
    udiv r2, r0, r2
    bx lr
"""


def state(machine: Machine) -> tuple[dict[str, int], int, int]:
    return machine.registers(), machine.cycles, machine.instructions


@pytest.mark.parametrize("part", [False, True])  # without and with flash waits and cache
def test_breakpoints_anywhere_change_no_cycle(load: Load, part: bool) -> None:
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


def test_watchpoints_stop_behind_the_access(load: Load) -> None:
    text = "ldr r0, [r1]\n strb r2, [r1, #3]\n str r2, [r1, #4]\n push {r0, r1}\n nop"
    machine = load(text, r1=DATA, r2=7, sp=DATA + 16)
    machine.watch(Watch(DATA + 3, 1, "w"))
    machine.watch(Watch(DATA + 12, 4, "a"))
    assert machine.run(FAR).reason == StopReason.WATCHPOINT
    hit = machine.watch_hit
    assert (hit.pc, hit.address, hit.size, hit.write) == (CODE + 2, DATA + 3, 1, True)
    assert machine.register("pc") == CODE + 4
    assert machine.run(FAR).reason == StopReason.WATCHPOINT
    assert (machine.watch_hit.address, machine.register("pc")) == (DATA + 12, CODE + 8)
    machine.watch(Watch(DATA + 3, 1, "w"), on=False)
    machine.watch(Watch(DATA + 12, 4, "a"), on=False)
    assert machine.run(machine.now_ps + 2_000_000).reason == StopReason.TIME


def test_a_run_ends_at_its_time(load: Load) -> None:
    machine = load("1: adds r0, #1\n adds r0, #1\n adds r0, #1\n b 1b", r0=0)
    for until in range(1, 200):
        machine.run(until * 1_000_000)
        assert until <= machine.cycles < until + 2


def test_the_end_of_memory(load: Load) -> None:
    machine = load("nop\n nop", at=0x2001_FFFC)
    steps(machine, 2)
    machine.step()
    assert status(machine) & FETCH_BUS
    # A 32-bit instruction whose second half is not there.
    machine = load("nop", at=0x2001_FFFC)
    machine.poke(0x2001_FFFE, bytes.fromhex("40f2"))
    steps(machine, 2)
    assert status(machine) & FETCH_BUS

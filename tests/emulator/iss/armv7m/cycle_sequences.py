"""Instruction sequences whose cycles public sources state.

Each has its code beside its source text, so that no assembler is needed to run it;
``test_cycles.py`` compares the two where there is one.

A whole program beside these: AES blocks of 10, 12 and 14 rounds by github.com/jnk0le/cortexm-AES,
CM3_1T, take 657, 779 and 901 cycles on an STM32F103 without wait states, so its README; the same
instructions take 631, 747 and 863 here, 4 % fewer. An unrolled round is 55 cycles there and here;
what is missing is in the branch that closes the loop.
"""

from typing import NamedTuple

TABLE = "Cortex-M3 Technical Reference Manual r2p1 (ARM DDI 0337I), table 3-1"
PAIRING = "the same, section 3.3.2, load/store timings"
MEASURED = "measured on an STM32F103: github.com/jnk0le/random, pipeline cycle test, cortex_m3m4.md"
DELAY = "Arduino Due core, delayMicroseconds(): a turn of SUBS and BNE taken as 3 cycles"


class Sequence(NamedTuple):
    """Instructions and what they take, with zero wait states.

    Attributes:
        name: of it.
        text: assembler; the registers hold what ``test_cycles.py`` says.
        code: its half-words, in bytes.
        least: fewest cycles that the source allows.
        most: most of them; the same unless the source gives a range.
        source: who says so.
    """

    name: str
    text: str
    code: str
    least: int
    most: int
    source: str


SEQUENCES = (
    Sequence(
        "moves",
        ("mov r4, r5; mov r4, r5, lsl #3; movw r4, #1234; movt r4, #1234; mvn r4, r5"),
        ("2c464feac50440f2d244c0f2d2446fea0504"),
        5,
        5,
        TABLE,
    ),
    Sequence(
        "sums",
        (
            "add r4, r5, r7; adcs r4, r5; sub r4, r5, #7; rsb r4, r5, #0; "
            "add r4, r5, r7, ror #3; cmp r4, r5"
        ),
        ("05eb07046c41a5f10704c5f1000405ebf704ac42"),
        6,
        6,
        TABLE,
    ),
    Sequence(
        "logic",
        ("and r4, r5, r7; orr r4, r5, #1; eors r4, r5; bics r4, r5; tst r4, r5; teq r4, r5"),
        ("05ea070445f001046c40ac432c4294ea050f"),
        6,
        6,
        TABLE,
    ),
    Sequence(
        "shifts",
        ("lsls r4, r5, #3; lsr r4, r5, r7; asrs r4, r7; ror r4, r5, r7; rrx r4, r5"),
        ("ec0025fa07f43c4165fa07f44fea3504"),
        5,
        5,
        TABLE,
    ),
    Sequence(
        "bit fields",
        ("ubfx r4, r5, #3, #9; sbfx r4, r5, #3, #9; bfi r4, r5, #3, #9; bfc r4, #3, #9"),
        ("c5f3c80445f3c80465f3cb046ff3cb04"),
        4,
        4,
        TABLE,
    ),
    Sequence(
        "reversals and extensions",
        ("rev r4, r5; rev16 r4, r5; rbit r4, r5; clz r4, r5; sxtb r4, r5; uxth r4, r5"),
        ("2cba6cba95faa5f4b5fa85f46cb2acb2"),
        6,
        6,
        TABLE,
    ),
    Sequence("saturation", ("ssat r4, #7, r5; usat r4, #7, r5"), ("05f3060485f30704"), 2, 2, TABLE),
    Sequence("MUL", ("mul r4, r5, r7; mul r4, r5, r5"), ("05fb07f405fb05f4"), 2, 2, TABLE),
    Sequence(
        "MLA and MLS", ("mla r4, r5, r7, r4; mls r4, r5, r7, r4"), ("05fb074405fb1744"), 4, 4, TABLE
    ),
    Sequence("UMULL of small factors", ("umull r4, r12, r7, r7"), ("a7fb074c"), 3, 3, TABLE),
    Sequence("UMULL of large factors", ("umull r4, r12, r8, r8"), ("a8fb084c"), 5, 5, TABLE),
    Sequence("SMULL", ("smull r4, r12, r5, r7"), ("85fb074c"), 3, 5, TABLE),
    Sequence("UMLAL of small factors", ("umlal r11, r12, r7, r7"), ("e7fb07bc"), 4, 4, TABLE),
    Sequence("UMLAL of large factors", ("umlal r4, r9, r8, r8"), ("e8fb0849"), 7, 7, TABLE),
    Sequence("UDIV of a smaller dividend", ("udiv r4, r7, r8"), ("b7fbf8f4"), 2, 2, TABLE),
    Sequence("UDIV of the longest quotient", ("udiv r4, r8, r9"), ("b8fbf9f4"), 12, 12, TABLE),
    Sequence("SDIV", ("sdiv r4, r5, r7"), ("95fbf7f4"), 2, 12, TABLE),
    Sequence("SDIV by 0", ("sdiv r4, r5, r12"), ("95fbfcf4"), 2, 2, TABLE),
    Sequence("load", ("ldr r4, [r0]"), ("0468"), 2, 2, TABLE),
    Sequence("load, used at once", ("ldr r4, [r0]; add r4, r4, #1"), ("046804f10104"), 3, 3, TABLE),
    Sequence(
        "bytes and halves",
        ("ldrb r4, [r0]; adds r4, #1; ldrsh r4, [r0]; adds r4, #1"),
        ("04780134b0f900400134"),
        6,
        6,
        TABLE,
    ),
    Sequence("two loads", ("ldr r4, [r1]; ldr r5, [r3]"), ("0c681d68"), 3, 3, PAIRING),
    Sequence(
        "three loads",
        ("ldr r4, [r1, r2]; ldr r5, [r3]; ldr r7, [r3, #4]"),
        ("8c581d685f68"),
        4,
        4,
        PAIRING,
    ),
    Sequence(
        "load whose address was loaded",
        ("ldr r4, [r10]; ldr r5, [r4]"),
        ("daf800402568"),
        4,
        4,
        PAIRING,
    ),
    Sequence("load, store", ("ldr r4, [r1, r2]; str r4, [r3, #20]"), ("8c585c61"), 3, 3, PAIRING),
    Sequence(
        "load, store with an offset register",
        ("ldr r4, [r1, r2]; str r5, [r3, r2]"),
        ("8c589d50"),
        3,
        3,
        PAIRING,
    ),
    Sequence("address of a sum", ("add r4, r0, #4; ldr r5, [r4]"), ("00f104042568"), 4, 4, PAIRING),
    Sequence("store", ("str r4, [r0, #4]; add r4, r4, #1"), ("446004f10104"), 2, 2, PAIRING),
    Sequence(
        "store with an offset register",
        ("str r4, [r0, r2]; add r4, r4, #1"),
        ("845004f10104"),
        3,
        3,
        PAIRING,
    ),
    Sequence(
        "four stores",
        ("str r4, [r0]; str r4, [r0, #4]; str r5, [r0, #8]; str r7, [r0, #12]; adds r4, #1"),
        ("046044608560c7600134"),
        5,
        5,
        MEASURED,
    ),
    Sequence("store, load", ("str r4, [r0, #4]; ldr r5, [r0, #8]"), ("44608568"), 4, 4, MEASURED),
    Sequence(
        "loads with write-back",
        ("ldr r4, [r1], #4; ldr r5, [r3], #4"),
        ("51f8044b53f8045b"),
        4,
        4,
        MEASURED,
    ),
    Sequence("LDRD", ("ldrd r4, r5, [r0]"), ("d0e90045"), 3, 3, PAIRING),
    Sequence("STRD", ("strd r4, r5, [r0]; adds r4, #1"), ("c0e900450134"), 4, 4, PAIRING),
    Sequence("LDM of three", ("ldm r0, {r4, r5, r7}"), ("90e8b000"), 4, 4, PAIRING),
    Sequence(
        "STM of eight", ("stm r0, {r1-r5, r7-r9}; adds r4, #1"), ("80e8be030134"), 10, 10, PAIRING
    ),
    Sequence("PUSH and POP", ("push {r4, r5, r7}; pop {r4, r5, r7}"), ("b0b4b0bc"), 8, 8, TABLE),
    Sequence("word at half a word", ("ldr r4, [r0, #2]"), ("d0f80240"), 3, 3, PAIRING),
    Sequence("word at an odd byte", ("ldr r4, [r0, #1]"), ("d0f80140"), 4, 4, PAIRING),
    Sequence("half at an odd byte", ("ldrh r4, [r0, #1]"), ("b0f80140"), 3, 3, PAIRING),
    Sequence("exclusive load", ("ldrex r4, [r0]"), ("50e8004f"), 2, 2, TABLE),
    Sequence(
        "exclusive load, load", ("ldrex r4, [r0]; ldr r5, [r3]"), ("50e8004f1d68"), 3, 3, PAIRING
    ),
    Sequence("exclusive store", ("strex r4, r5, [r0]"), ("40e80054"), 2, 2, TABLE),
    Sequence("branch", ("b 1f; .p2align 2; 1:"), ("00e000bf"), 2, 4, TABLE),
    Sequence("branch not taken", ("cmp r12, #1; beq 1f; 1:"), ("bcf1010fffd0"), 2, 2, TABLE),
    Sequence("branch taken", ("cmp r12, #0; beq 1f; nop; 1:"), ("bcf1000f00d000bf"), 3, 5, TABLE),
    Sequence("CBZ taken", ("cbz r7, 1f; cbnz r7, 1f; nop; 1:"), ("0fb107b900bf"), 3, 5, TABLE),
    Sequence(
        "call and return",
        ("bl 1f; b 2f; .p2align 2; 1: bx lr; .p2align 2; 2:"),
        ("00f002f802e000bf704700bf"),
        6,
        12,
        TABLE,
    ),
    Sequence("jump by a loaded address", ("ldr pc, [r0, #64]"), ("d0f840f0"), 5, 5, PAIRING),
    Sequence("table branch", ("tbb [pc, r12]; .byte 1, 1; 1:"), ("dfe80cf00101"), 6, 6, PAIRING),
    Sequence("POP of the PC", ("push {r4, r11}; pop {r4, pc}"), ("2de9100810bd"), 9, 9, TABLE),
    Sequence("NOPs", ("nop; nop; nop; nop"), ("00bf00bf00bf00bf"), 4, 4, TABLE),
    Sequence("folded IT", ("cmp r4, r5; it eq; moveq r4, r5"), ("ac4208bf2c46"), 2, 3, TABLE),
    Sequence(
        "special registers", ("mrs r4, primask; msr primask, r4"), ("eff3108484f31088"), 4, 4, TABLE
    ),
    Sequence("CPS", ("cpsid i; cpsie i"), ("72b662b6"), 2, 4, TABLE),
    Sequence("ISB", ("isb"), ("bff36f8f"), 2, 4, TABLE),
    Sequence(
        "counted delay",
        ("mov r4, #100; 1: subs r4, #1; bne 1b"),
        ("4ff06404013cfdd1"),
        300,
        300,
        DELAY,
    ),
)

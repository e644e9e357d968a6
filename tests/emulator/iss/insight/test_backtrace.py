"""Backtraces of hand-made stacks, by stack scan and by call frame information."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from cubestack.emulator.iss.insight.backtrace import (
    DEEPEST,
    EXC_RETURNS,
    INTERRUPTED,
    LR,
    PC,
    PSP,
    SP,
    Frame,
    backtrace,
)
from cubestack.emulator.iss.insight.symbols import Symbol, Symbols

STACK, OTHER_STACK = 0x2000_1000, 0x2000_3000
BL, BLX_R3, NOP_PAIR = 0xF800_F000, 0x4798_BF00, 0xBF00_BF00
SCAN = "by stack scan"


class Scene:
    """Four functions of 256 bytes from address 0x100 on, and memory word by word."""

    def __init__(self) -> None:
        self.words: dict[int, int] = {}
        symbols = Symbols(None)
        symbols.functions = [Symbol(f"f{n}", 0x100 * n, 0x100) for n in (1, 2, 3, 4)]
        symbols._starts = [one.address for one in symbols.functions]
        symbols.frames = []
        self.symbols = symbols
        self.registers = dict.fromkeys(range(16), 0) | {PC: 0x110, SP: STACK, LR: 0}

    def call(self, after: int, code: int = BL) -> int:
        """Put a call before the address ``after``; returns the return address."""
        self.words[after - 4] = code
        return after | 1

    def push(self, *words: int, at: int = STACK) -> None:
        for index, word in enumerate(words):
            self.words[at + 4 * index] = word

    def read(self, address: int, count: int) -> bytes:
        found = b""
        for at in range(address, address + count, 4):
            if at not in self.words:
                break
            found += self.words[at].to_bytes(4, "little")
        return found[:count]

    def frames(self) -> list[Frame]:
        return backtrace(self.symbols, self.registers, self.read)

    def rules(self, start: int, cfa: int | None, **saved: int) -> None:
        """Call frame information of the function at ``start``: its registers, from the CFA."""
        row: dict[Any, Any] = {"pc": start, "cfa": SimpleNamespace(reg=cfa and SP, offset=cfa)}
        for name, offset in saved.items():
            row[int(name[1:])] = SimpleNamespace(type="OFFSET", arg=offset)
        later = row | {"pc": start + 0x80, "cfa": SimpleNamespace(reg=None, offset=None)}
        record = SimpleNamespace(get_decoded=lambda: SimpleNamespace(table=[row, later]))
        self.symbols.frames.append((start, start + 0x100, cast("Any", record)))


@pytest.fixture
def scene() -> Scene:
    return Scene()


def test_leaf_returns_to_lr_and_its_callers_are_found_on_the_stack(scene: Scene) -> None:
    scene.registers[LR] = 0x221
    scene.push(7, 0x333, scene.call(0x340), 8, 9, scene.call(0x420, BLX_R3))
    assert scene.frames() == [
        Frame(0x110, 0x110),
        Frame(0x220, 0x21E),
        Frame(0x340, 0x33E, SCAN),
        Frame(0x420, 0x41E, SCAN),
    ]


@pytest.mark.parametrize("upper", [0x000, 0x001, 0x200, 0x7FF])
@pytest.mark.parametrize("lower", [0x000, 0x001, 0x7FF])
def test_bl_of_any_distance_is_a_call(scene: Scene, upper: int, lower: int) -> None:
    """Both halves hold eleven bits of the distance (ARMv7-M ARM, A7.7.18, encoding T1)."""
    code = (0xF800 | lower) << 16 | 0xF000 | upper
    scene.push(scene.call(0x340, code))
    assert scene.frames() == [Frame(0x110, 0x110), Frame(0x340, 0x33E, SCAN)]


@pytest.mark.parametrize(
    "code",
    [
        NOP_PAIR,
        0x4718_BF00,  # BX r3 is no call
        0x9000_F000,  # B.W is none either
        0xF800_E000,
    ],
)
def test_backtrace_skips_words_that_follow_no_call(scene: Scene, code: int) -> None:
    scene.push(scene.call(0x240, code), scene.call(0x340))
    assert scene.frames() == [Frame(0x110, 0x110), Frame(0x340, 0x33E, SCAN)]


def test_even_word_and_address_outside_the_program_are_skipped(scene: Scene) -> None:
    scene.push(scene.call(0x240) & ~1, scene.call(0x540), scene.call(0x340))
    assert [frame.address for frame in scene.frames()] == [0x110, 0x340]


def test_backtrace_finds_one_word_frames(scene: Scene) -> None:
    scene.push(scene.call(0x240), scene.call(0x340), scene.call(0x420))
    found = [scene.symbols.function_at(frame.place) for frame in scene.frames()]
    assert [one.name for one in found if one] == ["f1", "f2", "f3", "f4"]


def test_256_words_of_the_stack_are_searched(scene: Scene) -> None:
    for depth, found in ((255, 2), (256, 1)):
        scene.words.clear()
        scene.push(*[2] * depth, scene.call(0x340), *[2] * 8)
        assert len(scene.frames()) == found


def test_backtrace_has_at_most_24_frames(scene: Scene) -> None:
    scene.push(*[scene.call(0x340), scene.call(0x240)] * DEEPEST)
    assert len(scene.frames()) == DEEPEST == 24


@pytest.mark.parametrize("value", EXC_RETURNS)
@pytest.mark.parametrize("aligned", [0, 1])
def test_exception_is_followed_by_the_interrupted_function(
    scene: Scene, value: int, aligned: int
) -> None:
    """EXC_RETURN selects the stack: bit 2 is the process stack (ARMv7-M ARM, table B1-8)."""
    scene.rules(0x100, 8, r14=-4)
    scene.registers[PSP] = OTHER_STACK
    scene.push(0xAAAA, value)
    frame = (10, 11, 12, 13, 22, 0x331, 0x222, 0x0100_0000 | aligned << 9)
    interrupted = OTHER_STACK if value & 4 else STACK + 8
    scene.push(*frame, *[2] * aligned, scene.call(0x420), at=interrupted)
    # The interrupted f2 has saved LR on its own frame.
    scene.rules(0x200, 4, r14=-4)
    assert scene.frames() == [
        Frame(0x110, 0x110),
        Frame(0x222, 0x222, INTERRUPTED),
        Frame(0x420, 0x41E),
    ]


def test_unreadable_exception_frame_ends_the_backtrace(scene: Scene) -> None:
    scene.rules(0x100, 8, r14=-4)
    scene.push(0xAAAA, EXC_RETURNS[1], 1, 2, 3)
    assert len(scene.frames()) == 1


def test_unwinder_restores_the_registers_of_the_caller(scene: Scene) -> None:
    """Registers are saved below the canonical frame address, which is the caller's SP."""
    scene.rules(0x100, 12, r4=-12, r14=-4)
    scene.rules(0x200, 4, r14=-4)
    scene.push(44, 5, scene.call(0x220), scene.call(0x320))
    # f3 has no frame information: the rest is found by stack scan.
    scene.push(1, scene.call(0x410), at=STACK + 16)
    assert scene.frames() == [
        Frame(0x110, 0x110),
        Frame(0x220, 0x21E),
        Frame(0x320, 0x31E),
        Frame(0x410, 0x40E, SCAN),
    ]


def test_unwinder_uses_the_rule_of_the_current_address(scene: Scene) -> None:
    scene.rules(0x100, 4, r14=-4)
    scene.push(scene.call(0x220))
    scene.registers[PC] = 0x17E
    assert [frame.address for frame in scene.frames()] == [0x17E, 0x220]
    scene.registers[PC] = 0x180  # from here on, no rule for the frame address
    assert [frame.address for frame in scene.frames()] == [0x180]


@pytest.mark.parametrize(
    ("cfa", "saved_lr", "words"),
    [
        pytest.param(8, -4, [1], id="unreadable saved register"),
        pytest.param(4, -4, [0x901], id="caller outside all functions"),
        pytest.param(0, 0, [0x111], id="frame that is its own caller"),
    ],
)
def test_invalid_frame_ends_the_backtrace(
    scene: Scene, cfa: int, saved_lr: int, words: list[int]
) -> None:
    scene.rules(0x100, cfa, r14=saved_lr)
    scene.push(*words)
    assert len(scene.frames()) == 1

"""Backtraces of stacks that are built by hand: by stack scan, and by call frame information."""

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
from cubestack.emulator.iss.insight.symbols import Function, Symbols

STACK, OTHER_STACK = 0x2000_1000, 0x2000_3000
BL, BLX_R3, NOP_PAIR = 0xF800_F000, 0x4798_BF00, 0xBF00_BF00
SCAN = "by stack scan"


class Scene:
    """Four functions of 256 bytes from address 0x100 on, and memory word by word."""

    def __init__(self) -> None:
        self.words: dict[int, int] = {}
        symbols = Symbols(None)
        symbols.functions = [Function(f"f{n}", 0x100 * n, 0x100) for n in (1, 2, 3, 4)]
        symbols._starts = [one.address for one in symbols.functions]
        symbols.frames = []
        self.symbols = symbols
        self.registers = dict.fromkeys(range(16), 0) | {PC: 0x110, SP: STACK, LR: 0}

    def call(self, behind: int, code: int = BL) -> int:
        """A call in the program that ends at ``behind``; its return address."""
        self.words[behind - 4] = code
        return behind | 1

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


def test_a_leaf_returns_by_lr_and_its_callers_are_on_the_stack(scene: Scene) -> None:
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
def test_a_bl_is_a_call_however_far_it_goes(scene: Scene, upper: int, lower: int) -> None:
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
def test_a_word_that_no_call_ends_at_is_passed_over(scene: Scene, code: int) -> None:
    scene.push(scene.call(0x240, code), scene.call(0x340))
    assert scene.frames() == [Frame(0x110, 0x110), Frame(0x340, 0x33E, SCAN)]


def test_an_even_word_or_one_outside_of_the_program_is_none(scene: Scene) -> None:
    scene.push(scene.call(0x240) & ~1, scene.call(0x540), scene.call(0x340))
    assert [frame.address for frame in scene.frames()] == [0x110, 0x340]


def test_calls_that_saved_nothing_but_where_they_return_are_all_found(scene: Scene) -> None:
    scene.push(scene.call(0x240), scene.call(0x340), scene.call(0x420))
    found = [scene.symbols.function_at(frame.place) for frame in scene.frames()]
    assert [one.name for one in found if one] == ["f1", "f2", "f3", "f4"]


def test_only_so_much_of_the_stack_is_searched(scene: Scene) -> None:
    for depth, found in ((255, 2), (256, 1)):
        scene.words.clear()
        scene.push(*[2] * depth, scene.call(0x340), *[2] * 8)
        assert len(scene.frames()) == found


def test_it_ends_somewhere(scene: Scene) -> None:
    scene.push(*[scene.call(0x340), scene.call(0x240)] * DEEPEST)
    assert len(scene.frames()) == DEEPEST == 24


@pytest.mark.parametrize("value", EXC_RETURNS)
@pytest.mark.parametrize("aligned", [0, 1])
def test_an_exception_goes_on_with_what_it_interrupted(
    scene: Scene, value: int, aligned: int
) -> None:
    """EXC_RETURN tells the stack: bit 2 is that of a process (ARMv7-M ARM, table B1-8)."""
    scene.rules(0x100, 8, r14=-4)
    scene.registers[PSP] = OTHER_STACK
    scene.push(0xAAAA, value)
    frame = (10, 11, 12, 13, 22, 0x331, 0x222, 0x0100_0000 | aligned << 9)
    interrupted = OTHER_STACK if value & 4 else STACK + 8
    scene.push(*frame, *[2] * aligned, scene.call(0x420), at=interrupted)
    # The interrupted code is no leaf: f2 has saved LR behind its own frame.
    scene.rules(0x200, 4, r14=-4)
    assert scene.frames() == [
        Frame(0x110, 0x110),
        Frame(0x222, 0x222, INTERRUPTED),
        Frame(0x420, 0x41E),
    ]


def test_an_exception_s_frame_that_is_not_there_ends_it(scene: Scene) -> None:
    scene.rules(0x100, 8, r14=-4)
    scene.push(0xAAAA, EXC_RETURNS[1], 1, 2, 3)
    assert len(scene.frames()) == 1


def test_frame_information_restores_what_the_caller_s_frame_is_counted_from(scene: Scene) -> None:
    """Registers are saved below the canonical frame address, which is the caller's SP."""
    scene.rules(0x100, 12, r4=-12, r14=-4)
    scene.rules(0x200, 4, r14=-4)
    scene.push(44, 5, scene.call(0x220), scene.call(0x320))
    # Of f3 nothing is known: the search goes on behind.
    scene.push(1, scene.call(0x410), at=STACK + 16)
    assert scene.frames() == [
        Frame(0x110, 0x110),
        Frame(0x220, 0x21E),
        Frame(0x320, 0x31E),
        Frame(0x410, 0x40E, SCAN),
    ]


def test_frame_information_counts_up_to_the_end_of_a_function(scene: Scene) -> None:
    scene.rules(0x100, 4, r14=-4)
    scene.push(scene.call(0x220))
    scene.registers[PC] = 0x17E
    assert [frame.address for frame in scene.frames()] == [0x17E, 0x220]
    scene.registers[PC] = 0x180  # from there on, the frame's address is no register's
    assert [frame.address for frame in scene.frames()] == [0x180]


def test_a_saved_register_that_can_not_be_read_ends_it(scene: Scene) -> None:
    scene.rules(0x100, 8, r14=-4)
    scene.push(1)
    assert len(scene.frames()) == 1


def test_a_caller_that_is_no_function_ends_it(scene: Scene) -> None:
    scene.rules(0x100, 4, r14=-4)
    scene.push(0x901)
    assert len(scene.frames()) == 1


def test_a_frame_that_leads_to_itself_ends_it(scene: Scene) -> None:
    scene.rules(0x100, 0, r14=0)
    scene.push(0x111)
    assert len(scene.frames()) == 1

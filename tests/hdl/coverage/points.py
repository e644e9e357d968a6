"""Functional coverage: all points that the regression has to reach, declared once.

Rows of commands come from the interface tables.
"""

from collections.abc import Iterator
from functools import cache
from itertools import product

from cubestack.firmware_model.interface.cubesense import fpga
from cubestack.firmware_model.interface.cubesense.fpga import COMMANDS, Action, FpgaCommand
from cubestack.hdl.contract.points import Coverage, Group

#: What a writer can be doing when it is stopped. "Reset" is the two clocks after it was started.
STORE_STATES = (
    *("reset", "before a line", "in a line", "write pulse", "surplus pixels", "between lines"),
    *("between frames", "short last row", "ACK"),
)

#: Irregular things that a camera does, or is found at.
BORDERS = (
    *("joined in a line", "joined in a frame", "no VSYNC before a frame", "VSYNC in a line"),
    *("line too long", "line too short", "last row too short", "frame too short"),
    *("lines after ACK", "VSYNC after ACK", "clock stops low", "clock stops high"),
)

#: Border cases of pictures that were acknowledged.
_WITH_ACK_ONLY = ("lines after ACK", "VSYNC after ACK", "no VSYNC before a frame")

READ_STATES = ("no clock", "first row", "further rows", "last pixel", "wrapped")
SCAN_STATES = ("default", "A", "B", "C", "C again")
WINDOW_STATES = ("A", "B", "C", "D", "E", "E again")
SEND_STATES = ("line, clock high", "line, clock low", "pause, clock high", "pause, clock low")
TAKE_STATES = ("no byte", "one byte", "two bytes", "address", "more bytes")
READ_FROM_STATES = ("no clock", "addressed byte", "next bytes")

#: Pixel clocks in MHz: the range, the sensors' own, and between.
PIXEL_MHZ = (1.0, 2.0, 5.0, 10.0, 13.5, 20.0)

PHASES = 8  #: Steps of the pixel clock's phase against the processor's

#: The testbenches that ``harness.any_top`` and ``harness.rates`` run on.
TESTBENCHES = [f"{name}Testbench" for name in ("Published", "Shared", "Double", "Boards", "Pair")]

#: CubeStar's tops by the names of their designs.
CUBESTAR = {
    "CubeStarTop": "published",
    "CubeStarShared": "shared",
    "CubeStarDouble": "double",
    "CubeStarTwoBoards": "boards",
}
PAIRS = {"CubeSensePair": "pair", "addressable": "addressing"}
TOPS = CUBESTAR | PAIRS
SIDES = ("sun", "nadir")


def name_of(command: FpgaCommand) -> str:
    """A row of the command table as its levels: SHIFT EDGE RNW SUNEN NADEN."""
    return "".join("x" if level is None else str(level) for level in command.levels)


@cache
def row_of(*levels: int, mcu_addressing: bool) -> str:
    """The row that fits these levels, or the levels themselves where none does."""
    for command in COMMANDS + fpga.ADDRESSING_COMMANDS * mcu_addressing:
        if command.fits(*levels):
            return name_of(command)
    return "".join(map(str, levels))


def states_of(side: str, action: Action) -> tuple[str, ...]:
    of_sun = (side == "sun") == (action is Action.EDGE)
    return {
        **dict.fromkeys((Action.STORE, Action.STORE_OTHER), STORE_STATES),
        **dict.fromkeys((Action.EDGE, Action.SEND_EDGE), WINDOW_STATES if of_sun else SCAN_STATES),
        Action.READ: READ_STATES,
        Action.SEND_PICTURE: SEND_STATES,
        Action.PASS_EDGE: ("passing",),
        Action.TAKE_ADDRESS: TAKE_STATES,
        Action.READ_FROM: READ_FROM_STATES,
        Action.STANDBY: (),
    }[action]


def _rows(mcu_addressing: bool) -> Iterator[str]:
    yield from dict.fromkeys(
        row_of(*levels, mcu_addressing=mcu_addressing) for levels in product((0, 1), repeat=5)
    )


#: In a top's own commands.
ACTIONS = {
    top: {action for command in commands for action in command.actions}
    for top, commands in (("pair", COMMANDS), ("addressing", fpga.ADDRESSING_COMMANDS))
}
ALL_STATES = tuple(
    dict.fromkeys(s for side in SIDES for action in Action for s in states_of(side, action))
)

GROUPS = {
    "cubestar command": Group(
        "a command, how the camera's clock is then, and whether RNW comes with ENABLE or before",
        {
            "command": ("store", "read"),
            "bank": (0, 1),
            "camera": ("runs", "stopped high", "stopped low", "never ran"),
            "rnw": ("with ENABLE", "before"),
        },
        lambda command, bank, camera, rnw: (
            rnw == "before" or (camera, command) == ("runs", "store")
        ),
    ),
    "cubestar store": Group(
        "a store, what it was at when it was left, and by which pin",
        {"top": CUBESTAR.values(), "left_in": STORE_STATES, "left_by": ("ENABLE", "RNW", "both")},
        # RNW may not hand over the address of a shared memory while a picture is stored.
        lambda top, left_in, left_by: (
            top == "published" or left_by == "ENABLE" or (top, left_by) == ("double", "RNW")
        ),
    ),
    "cubestar read": Group(
        "a read-out, how far it came, and by which pin it was left",
        {"left_in": READ_STATES, "left_by": ("ENABLE", "RNW", "both")},
    ),
    "cubestar border": Group(
        "a border case, and whether a picture was acknowledged all the same",
        {"case": BORDERS, "acknowledged": ("yes", "no")},
        lambda case, acknowledged: case not in _WITH_ACK_ONLY or acknowledged == "yes",
    ),
    "bus": Group(
        "an access on the external bus, to which memory, and what the board is at",
        {
            "top": ("shared", "double", "boards"),
            "access": ("read", "write"),
            "memory": (0, 1),
            "board": ("has the bus", "stores there", "stores elsewhere", "standby"),
        },
    ),
    "pair command": Group(
        "a row of the command table, unlisted ones too, and the order of the enables",
        {
            "top": PAIRS.values(),
            "row": tuple(dict.fromkeys([*_rows(False), *_rows(True)])),
            "enables": ("together", "one by one"),
        },
        lambda top, row, enables: (
            row in _rows(top == "addressing")
            and row != "xxx11"
            and (enables == "together" or row.endswith("00"))
        ),
    ),
    "pair state": Group(
        "an action of an FPGA, and what it was at when it was left",
        {"top": PAIRS.values(), "side": SIDES, "action": tuple(Action), "state": ALL_STATES},
        lambda top, side, action, state: (
            state in states_of(side, action)
            and state != "before a line"  # a gap has ended, so that is a line
            and action in ACTIONS[top]
        ),
    ),
    "pair border": Group(
        "a border case of a camera, by the memory that stores it",
        {"camera": SIDES, "memory": SIDES, "case": BORDERS, "acknowledged": ("yes", "no")},
        lambda camera, memory, case, acknowledged: (
            (case not in _WITH_ACK_ONLY or acknowledged == "yes")
            and not case.startswith("clock stops")
            # Frames are told apart by their gaps, which no line is in.
            and case not in ("VSYNC in a line", "no VSYNC before a frame")
        ),
    ),
    "sun window": Group(
        "a Sun window that is read, by where the first Sun pixel is in the picture",
        {
            "memory": SIDES,
            "column": ("left", "inside", "right", "none"),
            "row": ("top", "inside", "bottom", "none"),
        },
        lambda memory, column, row: (column == "none") == (row == "none"),
    ),
    "failures": Group(
        "a sensor that measures although a camera is dead or a memory has failed",
        {"sensor": SIDES, "memory": SIDES, "dead": (*SIDES, ""), "failed": (*SIDES, "")},
        lambda sensor, memory, dead, failed: (
            sensor != dead
            and memory != failed
            and (dead or failed)
            # The good memory of the dead camera is where the other one's picture goes.
            and (not (dead and failed) or (memory == dead and failed == sensor))
        ),
    ),
    "rates": Group(
        "a picture stored and read back at fixed rates and phase of both clocks",
        {
            "testbench": TESTBENCHES,
            "pixel_mhz": PIXEL_MHZ,
            "data": ("37 cycles", "2 instructions", "1 MHz", "limit"),
            "phase": range(PHASES),
        },
    ),
    "pressure": Group(
        "pictures stored and read back with idle times and stalls of one kind",
        {
            "testbench": TESTBENCHES,
            "pressure": (
                *("steady", "stalling camera", "lopsided clock"),
                *("hurried processor", "slow processor"),
            ),
        },
    ),
}

COVERAGE = Coverage(GROUPS)
hit, merged, missed, table = COVERAGE.hit, COVERAGE.merged, COVERAGE.missed, COVERAGE.table

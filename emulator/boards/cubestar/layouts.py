"""CubeStar's memory layouts as boards: FPGA designs and supply currents.

CubeStar thesis, section 3.3, table 6.2 and section 7.2. The currents of the layouts that were never
built are derived from the published one. Its FPGA board contains an SRAM, whose current is assumed
equal to that of the processor's SRAM; here it is a separate part, because the program's supply
channel "memory" monitors the memory with the image. An FPGA with an open bus draws its standby
current; an access draws as much as reading.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from amaranth.hdl import Fragment

from cubestack.emulator.boards.cubestar import wiring
from cubestack.emulator.rtl.wiring import Wiring
from cubestack.emulator.sim.power import Part, PowerTable
from cubestack.firmware_model.interface.cubestar.pins import BOARD_PREFIXES, ENABLE, RNW, Layout

#: CubeStar thesis, sections 5.2.3 and 6.3, table 6.2: the whole stack's current in four modes. The
#: split into parts is fitted to them, one current per mode; two parts are known: the two LEDs
#: (396.2 mW less 350 mW), and the processor with 200 uA/MHz running and 50 uA/MHz asleep
#: (appendix E). Trip currents are assumed: a third above the highest regular current for the boards
#: with imager and FPGA, ten times the highest for the memory, which draws little.
CUBESTAR_POWER = PowerTable(
    volts=3.3,
    parts={
        "leds": Part(None, {"on": 14.0}),  # fitted: 46.2 mW
        "processor": Part(None, {"sleep": 2.4, "run": 9.6}),  # chosen: data sheet, 48 MHz
        "memory": Part("memory", {"standby": 2.0, "transfer": 3.0}),  # chosen share
        "imager": Part("imager", {"disabled": 42.8, "enabled": 92.8}),  # fitted: mode 2 less 1
        # Fitted: mode 3 less mode 2 and mode 4 less mode 1, less running processor and memory.
        "fpga": Part("imager", {"standby": 10.0, "storing": 58.9, "reading": 12.41}),
    },
    channels={"memory": 30.0, "imager": 200.0},
)

Pins = Mapping[str, int]
States = dict[str, str]


@dataclass(frozen=True)
class LayoutBoard:
    """FPGA design, wiring and power of the boards with one memory layout."""

    top: str  # name of the design in each of its FPGAs
    wiring: Callable[[], Wiring]
    power: PowerTable
    # states of the parts "fpga"... and "memory", from the control pins and whether the processor
    # accesses a memory
    states: Callable[[Pins, bool], States]
    boards: tuple[str, ...] = ("",)  # prefixes of the FPGAs' control pins
    external_ram: bool = False  # the processor has a separate memory

    @property
    def controls(self) -> tuple[str, ...]:
        """Pins that command the FPGAs; low after power-up."""
        return tuple(board + pin for board in self.boards for pin in (ENABLE, RNW))

    def storing(self, pins: Pins) -> int:
        """Number of memories that store images, from the control pins."""
        return sum(_stores(pins, board) for board in self.boards)


def _power_table(fpgas: tuple[str, ...], memories: int) -> PowerTable:
    """Currents with ``fpgas`` boards and ``memories`` memories as separate parts."""
    parts = dict(CUBESTAR_POWER.parts)
    whole, sram = parts.pop("fpga").ma, parts.pop("memory").ma
    idle, used = sram["standby"], sram["transfer"]
    alone = {state: ma - (idle if state == "standby" else used) for state, ma in whole.items()}
    memory = {f"{n} used": n * used + (memories - n) * idle for n in range(memories + 1)}
    parts |= {"memory": Part("memory", memory), **dict.fromkeys(fpgas, Part("imager", alone))}
    return replace(CUBESTAR_POWER, parts=parts)


def _stores(pins: Pins, board: str = "") -> bool:
    return bool(pins[f"{board}ENABLE"] and not pins[f"{board}RNW"])


def _copied_states(pins: Pins, _accessed: bool) -> States:
    state = "standby"
    if pins[ENABLE]:
        state = "reading" if pins[RNW] else "storing"
    return {"fpga": state, "memory": "transfer" if state == "reading" else "standby"}


def _one_fpga_states(pins: Pins, accessed: bool) -> States:
    """Storing and access at once occur only with two memories."""
    storing = _stores(pins)
    state = "storing" if storing else "reading" if accessed else "standby"
    return {"fpga": state, "memory": f"{storing + accessed} used"}


def _two_board_states(pins: Pins, accessed: bool) -> States:
    """An access goes to the first board that does not store."""
    storing = [_stores(pins, board) for board in BOARD_PREFIXES]
    reading = storing.index(False) if accessed and not all(storing) else None
    states = {
        f"fpga{number + 1}": "storing" if stores else "reading" if number == reading else "standby"
        for number, stores in enumerate(storing)
    }
    return {**states, "memory": f"{sum(storing) + (reading is not None)} used"}


BOARDS = {
    Layout.COPIED: LayoutBoard(
        "cubestar", wiring.cubestar_wiring, CUBESTAR_POWER, _copied_states, external_ram=True
    ),
    Layout.SHARED: LayoutBoard(
        "cubestar-shared",
        wiring.cubestar_shared_wiring,
        _power_table(("fpga",), 1),
        _one_fpga_states,
    ),
    Layout.TWO_MEMORIES: LayoutBoard(
        "cubestar-double",
        wiring.cubestar_double_wiring,
        _power_table(("fpga",), 2),
        _one_fpga_states,
    ),
    Layout.TWO_BOARDS: LayoutBoard(
        "cubestar-shared",
        wiring.cubestar_two_boards_wiring,
        _power_table(("fpga1", "fpga2"), 2),
        _two_board_states,
        BOARD_PREFIXES,
    ),
}


@dataclass(frozen=True)
class Fpga:
    """Pins and tiles that each FPGA of a layout uses, and those of the part."""

    pins: int
    tiles: int
    part_pins: int
    part_tiles: int

    @property
    def fits(self) -> bool:
        return self.pins <= self.part_pins and self.tiles <= self.part_tiles


def fpga_of(layout: Layout) -> Fpga:
    """Pins of the design, and its tiles in ``hdl/cubestar/area.json``."""
    from cubestack.hdl.cubestar.tops import AREA_FILE, TOPS
    from cubestack.hdl.flow.area import AGLN030_PINS, AGLN030_TILES
    from cubestack.hdl.flow.area_report import recorded_areas
    from cubestack.hdl.flow.top import tops_in

    name = BOARDS[layout].top
    component = tops_in(TOPS)[name].make()
    Fragment.get(component, None)  # Amaranth warns of a design that was never elaborated
    pins = sum(pin.width for pin in component.pins)
    return Fpga(pins, recorded_areas(AREA_FILE)[name]["tiles"], AGLN030_PINS, AGLN030_TILES)

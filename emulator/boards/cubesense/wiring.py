"""Wiring of CubeSense's two FPGAs."""

import re
from collections.abc import Callable, Collection, Mapping
from functools import cache, partial

from cubestack.emulator.rtl.wiring import CameraPins, Level, MemoryPins, Wiring
from cubestack.firmware_model.interface.cubesense import pins
from cubestack.firmware_model.interface.cubesense.fpga import COMMANDS, Action, actions
from cubestack.firmware_model.interface.cubesense.pins import CONTROLS, PREFIXES
from cubestack.hdl.blocks.pinned import RtlilComponent
from cubestack.hdl.cubesense.dataflow import SIDES, Side
from cubestack.hdl.cubesense.foreign_pair import ForeignPair
from cubestack.hdl.cubesense.pair import CubeSensePair
from cubestack.hdl.cubesense.top import CubeSenseFpga


def cubesense_wiring(pair: CubeSensePair | None = None, *, mcu_addressing: bool = False) -> Wiring:
    """Both FPGAs: cameras and memories "sun" and "nadir".

    A camera's pixel clock has an effect while an FPGA stores its image and has not raised ACK.
    Without ``pair``, the full-size pair with ``mcu_addressing`` is used.
    """
    if pair is None:
        pair = CubeSensePair(mcu_addressing=mcu_addressing)

    acks = tuple(pins.ACKNOWLEDGE.values())

    def storing(level: Level) -> Collection[str]:
        clocks = _clocks_used(*(level(name) for name in CONTROLS))
        return [clock for clock, ack in zip(clocks, acks, strict=True) if clock and not level(ack)]

    return Wiring(
        pair,
        cameras=tuple(
            CameraPins(side, *(prefix + pin for pin in (pins.PCLK, pins.Y, pins.HREF)))
            for side, prefix in PREFIXES.items()
        ),
        memories=tuple(MemoryPins(side, prefix) for side, prefix in PREFIXES.items()),
        data_clock=pins.CLK,
        data=pins.DATA,
        acknowledges=acks,
        storing=storing,
        # Two clocks release the reset, one ends the store, one the line;
        # then the gap between two frames is counted.
        settling_clocks=8 + pair.read_out.frame_gap,
        contention=pins.CONTENTION,
        burst_levels=tuple(
            ((pins.CLK, 0), *zip(CONTROLS, (level or 0 for level in command.levels), strict=True))
            for command in COMMANDS
            if {Action.STORE, Action.STORE_OTHER} & {*command.actions}
        ),
    )


def with_designs(wiring: Wiring, text: str, parameters: str = "") -> Wiring:
    """``wiring`` with a user's designs; see ``with_gateware``.

    ``text`` names a design of the whole pair, or is "sun=DESIGN", "nadir=DESIGN", or both with a
    comma between: each for one FPGA, whose ports are those of ``CubeSenseFpga``.
    """
    if not text and not parameters:
        return wiring
    from cubestack.emulator.boards.gateware import fitted, load, with_gateware

    parts = [part.partition("=") for part in re.split(r",(?=(?:sun|nadir)=)", text)]
    if any(side not in SIDES for side, _, _ in parts):
        return with_gateware(wiring, text, parameters)
    pair = wiring.component
    assert isinstance(pair, CubeSensePair)
    shape = pair.read_out, pair.mcu_addressing
    designs: dict[Side, RtlilComponent] = {
        side: load(design, CubeSenseFpga(side, *shape).pins, parameters)
        for side in SIDES
        for name, _, design in parts
        if name == side
    }
    return fitted(wiring, ForeignPair(designs, *shape))


@cache
def _clocks_used(*controls: int) -> tuple[str | None, str | None]:
    """The cameras whose images are stored in the Sun's memory, and in the nadir's."""
    acts = actions(*controls)
    sun = {Action.STORE: "sun", Action.STORE_OTHER: "nadir"}.get(acts.sun)
    nadir = {Action.STORE: "nadir", Action.STORE_OTHER: "sun"}.get(acts.nadir)
    return sun, nadir


#: Wirings of whole boards, by the names of their tops.
WIRINGS: Mapping[str, Callable[[], Wiring]] = {
    "cubesense-pair": cubesense_wiring,
    "cubesense-pair-addressing": partial(cubesense_wiring, mcu_addressing=True),
}

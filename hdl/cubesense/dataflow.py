"""Dataflow control: the action of one of CubeSense's FPGAs at each level of the control lines.

CubeSense thesis, section 6.4.2 and table 6.4. The rows are those of the command table in
:mod:`cubestack.firmware_model.interface.cubesense.fpga`; every other combination is standby. The
rows of its second table are optional.
"""

from dataclasses import replace
from typing import Literal, get_args

from amaranth.hdl import Cat, Module, Value
from amaranth.lib.wiring import Component, In, Out

from cubestack.firmware_model.interface.cubesense import fpga as table
from cubestack.firmware_model.interface.cubesense.fpga import Action, FpgaCommand

Side = Literal["sun", "nadir"]
SIDES: tuple[Side, ...] = get_args(Side)


def check_side(side: Side) -> Side:
    """Return ``side``; raise ValueError if it is unknown."""
    if side not in SIDES:
        raise ValueError(f'side must be "sun" or "nadir", not {side!r}')
    return side


#: Output of each action; the last two only with address control from the microcontroller.
_OUTPUTS = {
    Action.STORE: "store",
    Action.READ: "read",
    Action.EDGE: "edge_data",
    Action.SEND_PICTURE: "send_picture",
    Action.STORE_OTHER: "store_other",
    Action.SEND_EDGE: "send_edge",
    Action.PASS_EDGE: "pass_edge",
    Action.TAKE_ADDRESS: "take_address",
    Action.READ_FROM: "read_from",
}


class DataflowControl(Component):
    """Decodes the control lines; combinational.

    Ports:
        en_n: own enable, active low.
        other_en_n: the other FPGA's enable, as the link shows it; ignored when the link cannot.
        rnw, edge, shift: the other control lines.
        store, read, edge_data, send_picture, store_other, send_edge, pass_edge: the output of the
            selected action is high (``edge_data`` is EDGE); in standby none is.
        take_address, read_from: likewise, with ``mcu_addressing`` only.
        addressing: one of these two, without a glitch while SHIFT switches between them.
    """

    def __init__(self, side: Side, *, mcu_addressing: bool = False) -> None:
        self._side = side
        self._mcu_addressing = mcu_addressing
        self._outputs = dict(_OUTPUTS if mcu_addressing else list(_OUTPUTS.items())[:-2])
        names = (*self._outputs.values(), *("addressing",) * mcu_addressing)
        inputs = ("en_n", "other_en_n", "rnw", "edge", "shift")
        super().__init__({**dict.fromkeys(inputs, In(1)), **dict.fromkeys(names, Out(1))})

    def elaborate(self, platform: object) -> Module:
        m = Module()
        if self._mcu_addressing:
            m.d.comb += self.addressing.eq(self._addressing())
        for command in table.COMMANDS + table.ADDRESSING_COMMANDS * self._mcu_addressing:
            action = getattr(command.actions, self._side)
            if action is not Action.STANDBY:
                with m.If(self._fits(command)):
                    m.d.comb += getattr(self, self._outputs[action]).eq(1)
        return m

    def _fits(self, command: FpgaCommand) -> Value:
        """Whether the lines have the levels of a row.

        The other enable is not an input where it makes no difference, so that it cannot disturb an
        image that is being stored, nor where the link cannot show it: there the line itself depends
        on the result.
        """
        own, other = command.sunen, command.naden
        if self._side == "nadir":
            own, other = other, own
        levels = [
            (self.shift, command.shift),
            (self.edge, command.edge),
            (self.rnw, command.rnw),
            (self.en_n, own),
            (self.other_en_n, other if self._depends_on_other(command) else None),
        ]
        return Cat(line == level for line, level in levels if level is not None).all()

    def _addressing(self) -> Value:
        """The rows of address control without SHIFT, which merges them into one condition."""
        rows = [replace(command, shift=None) for command in table.ADDRESSING_COMMANDS]
        own = [row for row in rows if getattr(row.actions, self._side) is not Action.STANDBY]
        return Cat(self._fits(row) for row in own).any()

    def _depends_on_other(self, command: FpgaCommand) -> bool:
        """Whether this FPGA sees the other enable and would act differently at its other level."""
        shift, edge, rnw = (int(bool(x)) for x in (command.shift, command.edge, command.rnw))
        enables = [command.sunen, command.naden]
        enables[1 if self._side == "sun" else 0] ^= 1
        flipped = table.actions(shift, edge, rnw, *enables, mcu_addressing=self._mcu_addressing)
        both = [getattr(taken, self._side) for taken in (flipped, command.actions)]
        return table.link_shows_enables(shift, edge) and both[0] is not both[1]

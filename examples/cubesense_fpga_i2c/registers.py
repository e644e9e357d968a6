"""Registers of a CubeSense FPGA on I2C: commands in, state, Sun and memory out.

CubeSense thesis, section 9.2.1. The registers are those of
:mod:`cubesense_fpga_i2c.register_table`; all are in the domain of the
falling SCL.
"""

from functools import reduce
from operator import or_

from amaranth.hdl import Cat, Const, Module, Signal, Value
from amaranth.lib.cdc import FFSynchronizer
from amaranth.lib.wiring import Component, In, Out

from cubesense_fpga_i2c.pointer import MemoryPointer
from cubesense_fpga_i2c.register_table import (
    ADDRESSES,
    GROUP_ADDRESS,
    I2C_COMMANDS,
    REGISTER_BITS,
    REGISTERS,
    RESET_COMMAND,
    WHO,
    CommandBits,
    Register,
    command_byte,
    command_of,
)
from cubesense_fpga_i2c.target import I2cTarget
from cubestack.firmware_model.interface.cubesense.fpga import Action, FpgaCommand, ReadOut
from cubestack.hdl.cubesense.dataflow import Side


class CubeSenseI2cRegisters(Component):
    """The target with its registers, in the domain ``domain`` of the parent's making.

    Ports:
        scl, sda, sda_low: the bus; see :class:`I2cTarget`.
        store, store_other, send_picture, read: one is high, the one with the name of the action
            that COMMAND gives this side; none in standby.
        ack: a whole picture is stored; comes with any clock.
        sun: row : column of the first Sun pixel. Comes with a pixel clock, and is looked at only
            while nothing is stored, when it stands still.
        address: the pointer; 0 unless ``read``.
        memory: what the memory offers there.
    """

    def __init__(self, side: Side, read_out: ReadOut, *, domain: str = "bus") -> None:
        """Make the registers of the sun sensor's or the nadir sensor's FPGA."""
        self._side = side
        self._read_out = read_out
        self._domain = domain
        width = read_out.address_bits
        super().__init__(
            {
                "scl": In(1),
                "sda": In(1),
                "sda_low": Out(1),
                "store": Out(1),
                "store_other": Out(1),
                "send_picture": Out(1),
                "read": Out(1),
                "ack": In(1),
                "sun": In(width),
                "address": Out(width),
                "memory": In(8),
            }
        )

    def elaborate(self, platform: object) -> Module:
        """Build target, command register, pointer, and what is read."""
        m = Module()
        m.submodules.target = target = I2cTarget(
            ADDRESSES[self._side], GROUP_ADDRESS, number_bits=REGISTER_BITS, domain=self._domain
        )
        m.submodules.pointer = pointer = MemoryPointer(self._read_out, domain=self._domain)
        m.d.comb += [
            target.scl.eq(self.scl),
            target.sda.eq(self.sda),
            self.sda_low.eq(target.sda_low),
        ]

        command = Signal(4, init=RESET_COMMAND)
        chosen = {register: _is(target.number, register) for register in Register}
        taken = target.write & target.writable
        with m.If(taken & chosen[Register.COMMAND]):
            m.d[self._domain] += command.eq(target.byte)
        loads = (Register.POINTER_LOW, Register.POINTER_MID, Register.POINTER_HIGH)
        m.d.comb += [
            target.writable.eq(
                (chosen[Register.COMMAND] & target.group)
                | Cat(chosen[register] for register in loads).any()
            ),
            pointer.load.eq(Cat(taken & chosen[register] for register in loads)),
            pointer.byte.eq(target.byte),
            pointer.step.eq(target.read & chosen[Register.DATA]),
            self.address.eq(pointer.address & self.read.replicate(len(self.address))),
        ]
        outputs = {
            Action.STORE: self.store,
            Action.STORE_OTHER: self.store_other,
            Action.SEND_PICTURE: self.send_picture,
            Action.READ: self.read,
        }
        for action, output in outputs.items():
            rows = [row for row in I2C_COMMANDS if getattr(row.actions, self._side) is action]
            m.d.comb += output.eq(Cat(self._fits(command, row) for row in rows).any())

        # SCL runs for a byte at least before it is looked at, so it is two periods old at most.
        acknowledged = Signal()
        m.submodules.ack_crossing = FFSynchronizer(
            self.ack, acknowledged, o_domain=self._domain, reset_less=False
        )
        storing = self.store | self.store_other
        sun = self.sun & (~storing).replicate(len(self.sun))
        values = {
            Register.WHO_AM_I: Const(WHO[self._side], 8),
            Register.STATUS: Cat(acknowledged, storing, self.send_picture, self.read),
            Register.COMMAND: command,
            Register.SUN_HIGH: sun[16:],
            Register.SUN_MID: sun[8:16],
            Register.SUN_LOW: sun[:8],
            Register.POINTER_HIGH: pointer.address[16:] | (pointer.down << 7),
            Register.POINTER_MID: pointer.address[8:16],
            Register.POINTER_LOW: pointer.address[:8],
            Register.DATA: self.memory & self.read.replicate(8),
        }
        selected = [
            values[Register(register.address)] & chosen[Register(register.address)].replicate(8)
            for register in REGISTERS
        ]
        m.d.comb += target.value.eq(reduce(or_, selected))
        return m

    def _fits(self, command: Signal, row: FpgaCommand) -> Value:
        """Whether the command's bits are at the levels of a row.

        The other enable is no input where it makes no difference, so that it can not disturb a
        picture that is being stored.
        """
        levels = {
            CommandBits.SHIFT: row.shift,
            CommandBits.RNW: row.rnw,
            CommandBits.SUNEN: row.sunen,
            CommandBits.NADEN: row.naden,
        }
        other = CommandBits.NADEN if self._side == "sun" else CommandBits.SUNEN
        flipped = command_of(command_byte(row.actions) ^ other)
        if getattr(flipped, self._side) is getattr(row.actions, self._side):
            del levels[other]
        return Cat(command[bit.bit_length() - 1] == level for bit, level in levels.items()).all()


def _is(number: Signal, register: Register) -> Value:
    """Whether it is that register's; a comparison with 0 is no Verilog that linters like."""
    return number == register if register else ~number.any()

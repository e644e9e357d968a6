"""A machine without peripherals and unicorn's Cortex-M3, which run the same slices."""

from collections.abc import Mapping

import unicorn
from unicorn import arm_const

from cubestack.emulator.iss.machine import Machine
from cubestack.emulator.iss.outcome import StopReason

from .programs import END, RAM, RAM_BYTES, Slice

_U = arm_const
_NAMES = (*(f"r{n}" for n in range(13)), "sp", "lr", "pc", "xpsr", "psp", "msp", "primask",
          "faultmask", "control")  # fmt: skip
_IDS = (*(getattr(_U, f"UC_ARM_REG_R{n}") for n in range(13)), _U.UC_ARM_REG_SP, _U.UC_ARM_REG_LR,
        _U.UC_ARM_REG_PC, _U.UC_ARM_REG_XPSR, _U.UC_ARM_REG_PSP, _U.UC_ARM_REG_MSP,
        _U.UC_ARM_REG_PRIMASK, _U.UC_ARM_REG_FAULTMASK, _U.UC_ARM_REG_CONTROL)  # fmt: skip
_FOREVER = 1 << 60


class UnequalError(AssertionError):
    """The results differ."""


def cortex_m3(memories: Mapping[int, bytes]) -> unicorn.Uc:
    """Unicorn's Cortex-M3 with these memories by address."""
    oracle = unicorn.Uc(unicorn.UC_ARCH_ARM, unicorn.UC_MODE_THUMB | unicorn.UC_MODE_MCLASS)
    oracle.ctl_set_cpu_model(_U.UC_CPU_ARM_CORTEX_M3)
    for address, content in memories.items():
        oracle.mem_map(address, len(content))
        oracle.mem_write(address, content)
    return oracle


class Pair:
    """Both processors, with equal memories."""

    def __init__(self, flash: bytes, ram: bytes) -> None:
        self.machine = Machine(bare_hz=1_000_000, flash_bytes=0x10000, ram_bytes=RAM_BYTES)
        self.machine.flash[:] = 0xFF
        self.machine.flash[: len(flash)] = list(flash)
        self.machine.ram[:] = list(ram)
        self.machine.reset()
        self.oracle = cortex_m3({0: bytes(self.machine.flash), RAM: ram})
        self.machine.breakpoints.add(END)

    def prepare(self, slice_: Slice) -> None:
        """Write a slice and its registers to both."""
        code = b"".join(half.to_bytes(2, "little") for half in slice_.code)
        assert self.machine.poke(slice_.start, code) == len(code)
        self.oracle.mem_write(slice_.start, code)
        self.oracle.ctl_remove_cache(slice_.start, END)
        *values, psp, flags = slice_.registers
        machine, oracle = self.machine, self.oracle
        for name in ("primask", "faultmask", "control"):
            machine.set_register(name, 0)
        for name, value in zip(_NAMES[:15], values, strict=True):
            machine.set_register(name, value)
        machine.set_register("psp", psp)
        machine.set_register("xpsr", flags | 1 << 24)
        machine.set_register("pc", slice_.start)
        oracle.reg_write_batch([(_U.UC_ARM_REG_CONTROL, 0), (_U.UC_ARM_REG_PRIMASK, 0),
                                (_U.UC_ARM_REG_FAULTMASK, 0),
                                *zip(_IDS[:15], values, strict=True), (_U.UC_ARM_REG_PSP, psp),
                                (_U.UC_ARM_REG_XPSR, flags | 1 << 24)])  # fmt: skip

    def run(self, slice_: Slice) -> int:
        """Run a slice on both; returns the number of instructions, or raises UnequalError."""
        self.prepare(slice_)
        before = self.machine.instructions
        stop = self.machine.run(_FOREVER)
        try:
            self.oracle.emu_start(slice_.start | 1, END)
        except unicorn.UcError as error:
            there = self.oracle.reg_read(_U.UC_ARM_REG_PC)
            here = self.machine.register("pc")
            raise UnequalError(f"unicorn: {error}, at {there:#x}; {stop} at {here:#x}") from error
        if stop.reason != StopReason.BREAKPOINT:
            raise UnequalError(f"{stop} at {self.machine.register('pc'):#x}")
        self.compare()
        return self.machine.instructions - before

    def registers(self) -> tuple[dict[str, int], dict[str, int]]:
        """Registers of both by name."""
        theirs = dict(zip(_NAMES, self.oracle.reg_read_batch(_IDS), strict=True))
        ours = {name: self.machine.register(name) for name in _NAMES}
        for both in (theirs, ours):
            both["xpsr"] &= 0xF8000000
        return ours, theirs

    def compare(self) -> None:
        """Raise UnequalError if a register, a flag or a byte of RAM differs."""
        ours, theirs = self.registers()
        if ours != theirs:
            raise UnequalError(", ".join(f"{name}: {ours[name]:#x} here, {theirs[name]:#x} there"
                                    for name in ours if ours[name] != theirs[name]))  # fmt: skip
        if self.machine.ram.tobytes() != bytes(self.oracle.mem_read(RAM, RAM_BYTES)):
            there = bytes(self.oracle.mem_read(RAM, RAM_BYTES))
            at = next(i for i, b in enumerate(there) if self.machine.ram[i] != b)
            raise UnequalError(
                f"RAM at {RAM + at:#x}: {self.machine.ram[at]:#x} here, {there[at]:#x}"
            )

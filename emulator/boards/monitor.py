"""A debugger's ``monitor`` commands that concern the board; reads registers by their names."""

from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol

from cubestack.emulator.boards.pins import FLOATS, Pins
from cubestack.emulator.camera.common.register_file import RegisterFile
from cubestack.emulator.faults.injector import Faults
from cubestack.emulator.iss.insight.fault_report import fault_report
from cubestack.emulator.iss.insight.symbols import Symbols
from cubestack.emulator.iss.machine import Machine
from cubestack.emulator.rtl.contract import RtlEngine
from cubestack.emulator.sim import debugger_commands
from cubestack.emulator.sim.power import PowerModel
from cubestack.emulator.sim.virtual_time import PS_PER_S, Kernel
from cubestack.firmware_model.interface.efm32gg import LAYOUTS
from cubestack.firmware_model.interface.efm32gg.table import Instance, Layout

WORD = 4


class RegisterValue(NamedTuple):
    """A word of memory and its fields; ``value`` is None if it can not be read."""

    name: str
    value: int | None
    fields: dict[str, int]

    @property
    def text(self) -> str:
        if self.value is None:
            return "can not be read"
        shown = (f"{name}={value:#x}" for name, value in self.fields.items() if value)
        return f"{self.value:08x} {' '.join(shown)}".rstrip()


def peripherals() -> list[str]:
    return [instance.name for layout in LAYOUTS for instance in layout.instances]


def peek(machine: Machine, symbols: Symbols, what: str) -> list[RegisterValue]:
    """The words of a peripheral, a register (``CMU.CTRL``), a variable or an address.

    Raises ValueError for anything else.
    """
    unit, _, name = what.upper().partition(".")
    if unit in peripherals():
        return _registers(machine, *find_instance(unit), name)
    variable = symbols.variables.get(what)
    if variable is not None:
        words = range(variable.address & -WORD, variable.address + variable.size, WORD)
        return [_word(machine, address, what) for address in words]
    try:
        address = int(what, 0)
    except ValueError:
        known = ", ".join(peripherals())
        raise ValueError(f"no peripheral, variable or address {what!r}; known: {known}") from None
    return [_word(machine, address & 0xFFFF_FFFC, "")]


def find_instance(unit: str) -> tuple[Layout, Instance]:
    return next(
        (layout, instance)
        for layout in LAYOUTS
        for instance in layout.instances
        if instance.name == unit
    )


def _registers(
    machine: Machine, layout: Layout, instance: Instance, name: str
) -> list[RegisterValue]:
    found = [one for one in layout.registers if name in ("", one.name)]
    if not found:
        known = ", ".join(one.name for one in layout.registers)
        raise ValueError(f"{instance.name} has no register {name}; known: {known}")
    values = []
    for register in found:
        value = _value(machine, instance.base + register.offset)
        fields = {
            bits.name: (value & bits.mask) >> bits.lsb
            for bits in register.fields
            if bits.name and value is not None
        }
        values.append(RegisterValue(f"{instance.name}.{register.name}", value, fields))
    return values


def _word(machine: Machine, address: int, name: str) -> RegisterValue:
    return RegisterValue(f"{name} {address:08x}".lstrip(), _value(machine, address), {})


def _value(machine: Machine, address: int) -> int | None:
    data = machine.peek(address, WORD)
    return int.from_bytes(data, "little") if len(data) == WORD else None


HELP = """time              virtual time, core clock, sleep
camera            registers of the camera
power             supply currents
pins              FPGA pins from and to the processor; of a bare part, its driven pins
regs [WHAT]       a peripheral, UNIT.REGISTER, a variable or an address
faults            kinds of faults and their targets
faults inject KIND [TARGET] [PARAMETER=VALUE ...]
faults log|clear  effects of the faults; end all faults
symbols WHAT      an address, or a name
report            last fault of the firmware, registers, backtrace"""


class Camera(Protocol):
    """A camera with registers."""

    @property
    def registers(self) -> RegisterFile: ...


class FirmwareBoard(Protocol):
    """A board that runs a user's own firmware."""

    kernel: Kernel
    machine: Machine
    power: PowerModel

    @property
    def engine(self) -> RtlEngine | None: ...

    @property
    def pins(self) -> Pins | None: ...

    @property
    def faults(self) -> Faults: ...

    @property
    def camera(self) -> Camera | None: ...


class Monitor:
    """The commands on one board."""

    def __init__(self, board: FirmwareBoard, symbols: Symbols) -> None:
        self._board = board
        self._symbols = symbols
        self._commands: Mapping[str, Callable[[list[str]], str]] = {
            "help": lambda _words: HELP,
            "time": self._time,
            "camera": self._camera,
            "power": self._power,
            "pins": self._pins,
            "regs": self._registers,
            "faults": self._faults,
            "symbols": self._lookup,
            "report": self._report,
        }

    def __call__(self, words: list[str]) -> str:
        """Output of the command ``words``; ValueError for an invalid one."""
        command = self._commands.get(words[0])
        if command is None:
            known = ", ".join([*debugger_commands.KNOWN, *self._commands])
            raise ValueError(f"no command {words[0]!r}; known: {known}")
        return command(words[1:])

    def _time(self, _words: list[str]) -> str:
        machine = self._board.machine
        state = f"asleep in EM{machine.energy_mode}" if machine.asleep else "awake"
        return (
            f"{machine.now_ps / PS_PER_S:.12f} s, core cycle {machine.cycles} at {machine.hz} Hz, "
            f"{machine.instructions} instructions, {state}"
        )

    def _camera(self, _words: list[str]) -> str:
        camera = self._board.camera
        if camera is None:
            return "no camera"
        values = camera.registers.written()
        return "\n".join(f"{name:24} {value:#06x}" for name, value in values.items())

    def _power(self, _words: list[str]) -> str:
        power = self._board.power
        lines = [f"total {power.current_ma():.1f} mA"]
        for channel in power.table.channels:
            state = "on" if power.is_on(channel) else "off"
            lines.append(f"{channel} {state} {power.current_ma(channel):.1f} mA")
        return "\n".join(lines)

    def _pins(self, _words: list[str]) -> str:
        engine, pins = self._board.engine, self._board.pins
        if pins is not None:
            return "\n".join(
                f"{pin} {pins.driven(pin)}" for pin in pins if pins.driven(pin) != FLOATS
            )
        if engine is None:
            return "no FPGA"
        names = (*engine.wiring.mcu_pins, *engine.wiring.output_pins)
        return "\n".join(f"{name} {engine.get_pin(name):#x}" for name in names)

    def _registers(self, words: list[str]) -> str:
        if not words:
            return " ".join(peripherals())
        found = peek(self._board.machine, self._symbols, words[0])
        return "\n".join(f"{one.name} {one.text}" for one in found)

    def _faults(self, words: list[str]) -> str:
        faults = self._board.faults
        match words:
            case []:
                return "\n".join(f"{kind} {' '.join(to)}" for kind, to in faults.kinds().items())
            case ["log"]:
                return "\n".join(str(event) for event in faults.log)
            case ["clear"]:
                faults.clear()
                return ""
            case ["inject", *what] if what:
                faults.inject_words(what)
                return f"injected: {' '.join(what)}"
        raise ValueError("usage: faults [log|clear|inject KIND [TARGET] [PARAMETER=VALUE ...]]")

    def _lookup(self, words: list[str]) -> str:
        if len(words) != 1:
            raise ValueError("usage: symbols ADDRESS|NAME")
        found = self._symbols.labels.get(words[0])
        try:
            address = found if found is not None else int(words[0], 0)
        except ValueError:
            raise ValueError(f"no symbol {words[0]!r}") from None
        return self._symbols.describe(address & ~1)

    def _report(self, _words: list[str]) -> str:
        machine = self._board.machine
        return fault_report(machine, self._symbols, machine.now_ps)

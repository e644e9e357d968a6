"""Whatever a program writes to the serial, counting and analog units, time passes on."""

import random
import time

import pytest

from cubestack.firmware_model.interface.efm32gg import LAYOUTS

from .bench import Bench, S, asleep

UNITS = ("USART", "LEUART", "I2C", "TIMER", "LETIMER", "RTC", "BURTC", "PCNT", "ADC", "DAC", "ACMP",
         "VCMP", "DMA", "PRS", "GPIO")  # fmt: skip
REGISTERS = [
    (instance.base + register.offset, register.writable)
    for layout in LAYOUTS
    if layout.name in UNITS
    for instance in layout.instances
    for register in layout.registers
    if not register.name.startswith("RET")
]
PATIENCE_S = 20


@pytest.mark.parametrize("seed", range(12))
def test_random_writes_and_inputs_neither_hang_nor_end_it(seed: int) -> None:
    chance = random.Random(seed)
    bench = asleep(1) if seed % 2 else Bench()
    machine = bench.machine
    bench["CMU.HFPERCLKEN0"] = bench["CMU.HFCORECLKEN0"] = 0xFFFF_FFFF
    bench.command("CMU.OSCENCMD.LFRCOEN")
    bench["CMU.LFACLKEN0"] = bench["CMU.LFBCLKEN0"] = 0xFF
    bench["RMU.CTRL"] = 0
    bench.run_for(S // 1000)
    machine.poke(0x2000_0000, chance.randbytes(4096))
    began, wall = bench.now, time.monotonic()
    wanted = began
    for _ in range(600):
        match chance.randrange(8):
            case 0:
                machine.uart_receive(
                    chance.randrange(8), chance.randrange(512), chance.randrange(4)
                )
            case 1:
                machine.pin(chance.randrange(6), chance.randrange(16), chance.randrange(-1, 2))
            case 2:
                machine.analog[chance.randrange(27)] = chance.uniform(-1, 5)
                machine.analog_changed()
            case 3:
                unit = chance.randrange(2)
                getattr(machine, chance.choice(("i2c_slave_stop", "i2c_slave_poll")))(unit)
                machine.i2c_slave_start(unit, chance.randrange(256))
                machine.i2c_slave_write(unit, chance.randrange(256))
                machine.i2c_slave_read(unit, chance.random() < 0.5)
                machine.i2c_answer(unit, chance.random() < 0.5, chance.randrange(256))
            case 4:
                wanted += chance.randrange(20) * 1_000_000
                bench.run_until(wanted)
                wanted = bench.now
            case _:
                address, writable = chance.choice(REGISTERS)
                value = chance.getrandbits(32) & chance.getrandbits(32) & writable
                machine.write(address, value)
                machine.read(chance.choice(REGISTERS)[0])
        assert time.monotonic() - wall < PATIENCE_S
    assert bench.now > began

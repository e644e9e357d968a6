"""Peripherals of CubeSense's microcontroller, as its program uses them.

CubeSense thesis, table 3.3: two serial ports, the converter behind the current monitors, a timer.
"""

from cubestack.emulator.boards.contract import Board
from cubestack.emulator.boards.cubesense.gpio import CHANNELS
from cubestack.emulator.boards.peripherals import NodePeripherals
from cubestack.emulator.sim.virtual_time import PS_PER_US
from cubestack.firmware_model.cubesense.hardware import Port
from cubestack.firmware_model.interface.cubesense import pins
from cubestack.firmware_model.interface.cubesense.pins import Monitor


class Pic18f45k20(NodePeripherals):
    """The peripherals; see ``firmware_model.cubesense.hardware``."""

    serial_number = "CSEMU1"

    def __init__(self, board: Board, *, mcu_addressing: bool) -> None:
        super().__init__(board)
        self._reset_ps = 0
        self._uarts = dict(zip(Port, board.uarts.values(), strict=True))
        self.mcu_addressing = mcu_addressing

    def reset(self) -> None:
        self._reset_ps = self._board.kernel.now

    def uart_send(self, data: bytes, port: Port = Port.NODE) -> None:
        self._uarts[port].send(data)

    def uart_backlog(self, port: Port = Port.NODE) -> int:
        return self._uarts[port].backlog

    def adc_counts(self, monitor: Monitor) -> int:
        current_ma = self._board.power.current_ma
        match monitor:
            case Monitor.SUPPLY_5V:
                current = current_ma()
            case Monitor.SUPPLY_3V3:
                # The cameras' own regulator feeds them from the 5 V supply.
                cameras = (CHANNELS[pin] for pin in pins.CAMERA_POWER.values())
                current = current_ma() - sum(map(current_ma, cameras))
            case Monitor.SRAM1 | Monitor.SRAM2:
                current = current_ma(monitor.value)
        return min(pins.ADC_FULL_SCALE, round(current / pins.MA_PER_COUNT))

    def uptime_us(self) -> int:
        """Time since the latest reset in us."""
        return (self._board.kernel.now - self._reset_ps) // PS_PER_US

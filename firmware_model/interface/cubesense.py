"""CubeSense's whole interface: node protocol, register-pointer protocol and bench protocol.

Node protocol: CubeSpace family with two cameras, interface generation 2, node dialect on the UART.
The register-pointer and the bench protocol are those of the CubeSense thesis, section 6.4.3 and
appendix E. Ours where nothing is published: both I2C addresses, the register addresses,
telecommands from 100 and telemetry from 220 on.
"""

from cubestack.firmware_model.interface.cubesense_bench import BENCH
from cubestack.firmware_model.interface.cubesense_registers import REGISTERS
from cubestack.firmware_model.interface.cubesense_telecommands import TELECOMMANDS
from cubestack.firmware_model.interface.cubesense_telemetry import TELEMETRIES
from cubestack.firmware_model.interface.message import Interface
from cubestack.firmware_model.interface.node_codes import AckError

__all__ = ["INTERFACE"]

INTERFACE = Interface(
    name="CubeSense",
    version=2,
    i2c_address=0x1B,
    baud=57_600,
    telecommands=TELECOMMANDS,
    telemetries=TELEMETRIES,
    ack_errors=AckError,
    registers=REGISTERS,
    bench=BENCH,
)

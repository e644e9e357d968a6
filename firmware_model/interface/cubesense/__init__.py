"""CubeSense's whole interface: node protocol, register-pointer protocol, service port.

Node protocol: CubeSpace family with two cameras, interface generation 2, node dialect on the UART.
The register-pointer protocol and the service port's, for a bench computer, are those of the
CubeSense thesis, section 6.4.3 and appendix E. Extensions, or assumed where nothing is published:
both I2C addresses, the register addresses, telecommands from 100 and telemetry from 220 on.
"""

from cubestack.firmware_model.interface.codec.message import Interface
from cubestack.firmware_model.interface.codec.node_messages import AckError
from cubestack.firmware_model.interface.cubesense.registers import REGISTERS
from cubestack.firmware_model.interface.cubesense.service_port import SERVICE_PORT
from cubestack.firmware_model.interface.cubesense.switches import CubeSenseSwitches
from cubestack.firmware_model.interface.cubesense.telecommands import TELECOMMANDS
from cubestack.firmware_model.interface.cubesense.telemetry import TELEMETRIES

INTERFACE = Interface(
    name="CubeSense",
    version=2,
    node_type=4,  # assumed
    i2c_address=0x1B,
    baud=57_600,
    telecommands=TELECOMMANDS,
    telemetries=TELEMETRIES,
    ack_errors=AckError,
    switches=CubeSenseSwitches,
    registers=REGISTERS,
    service_port=SERVICE_PORT,
)

"""Area, Verilog and proofs of this package's designs: python -m cubesense_fpga_i2c --help."""

import argparse
import sys

from cubesense_fpga_i2c.proofs import PROOFS
from cubesense_fpga_i2c.tops import TOPS
from cubestack.host.cli import hdl

parser = argparse.ArgumentParser(
    prog="python -m cubesense_fpga_i2c",
    description=hdl.__doc__,
    formatter_class=argparse.RawDescriptionHelpFormatter,
)
hdl.add_arguments(parser, tops=lambda: TOPS, proofs=lambda: PROOFS)
try:
    sys.exit(hdl.run(parser.parse_args()))
except ValueError as error:
    parser.error(str(error))

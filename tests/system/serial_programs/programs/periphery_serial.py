"""python-periphery; words: the kind of the port, and its path."""

import sys

from periphery import Serial

with Serial(sys.argv[2], 57_600) as port:
    port.write(bytes.fromhex("1f7f801fff"))
    print(port.read(12, timeout=20)[2:6].hex())

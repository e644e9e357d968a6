"""serialx; words: the kind of the port, and its path or host:port."""

import sys

import serialx

KINDS = {"pty": "", "tcp": "socket://", "rfc2217": "rfc2217://"}

url = KINDS[sys.argv[1]] + sys.argv[2]
with serialx.serial_for_url(url, baudrate=57_600, read_timeout=20) as port:
    port.write(bytes.fromhex("1f7f801fff"))
    print(port.readexactly(12)[2:6].hex())

"""pyserial; words: the kind of the port, and its path or host:port."""

import sys

import serial

KINDS = {"pty": "", "tcp": "socket://", "rfc2217": "rfc2217://"}

with serial.serial_for_url(KINDS[sys.argv[1]] + sys.argv[2], 57_600, timeout=20) as port:
    port.write(bytes.fromhex("1f7f801fff"))
    print(port.read(12)[2:6].hex())

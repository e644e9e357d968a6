"""ser2net, which serves the port again; words: the kind of the port, and its path or host:port.

An RFC 2217 port is served as such, so that ser2net passes on pyserial's commands.
"""

import socket
import subprocess
import sys
import tempfile
from pathlib import Path

import serial

kind, place = sys.argv[1:3]
tcp = "tcp," + place.replace(":", ",")
accepter, connector, scheme = {
    "pty": ("tcp", f"serialdev,{place},57600n81,local", "socket"),
    "tcp": ("tcp", tcp, "socket"),
    "rfc2217": ("telnet(rfc2217=true),tcp", f"telnet(rfc2217=true),{tcp}", "rfc2217"),
}[kind]
with socket.create_server(("127.0.0.1", 0)) as probe:
    number = probe.getsockname()[1]


def opened() -> serial.SerialBase:
    while True:
        try:
            return serial.serial_for_url(f"{scheme}://127.0.0.1:{number}", 57_600, timeout=20)
        except serial.SerialException:
            assert process.poll() is None


with tempfile.TemporaryDirectory() as folder:
    settings = Path(folder, "ser2net.yaml")
    settings.write_text(
        "%YAML 1.1\n---\nconnection: &con\n"
        f"  accepter: {accepter},127.0.0.1,{number}\n  connector: {connector}\n"
    )
    with subprocess.Popen(["ser2net", "-d", "-c", settings, "-P", f"{folder}/pid"]) as process:
        try:
            with opened() as port:
                port.write(bytes.fromhex("1f7f801fff"))
                print(port.read(12)[2:6].hex())
        finally:
            process.terminate()

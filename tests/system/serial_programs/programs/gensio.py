"""gensiot; words: the kind of the port, and its path or host:port."""

import subprocess
import sys

kind, place = sys.argv[1:3]
tcp = "tcp," + place.replace(":", ",")
chain = {
    "pty": f"serialdev,{place},57600n81,local",
    "tcp": tcp,
    "rfc2217": f"telnet(rfc2217=true),{tcp}",
}
with subprocess.Popen(
    ["gensiot", "-i", "stdio(self,raw)", chain[kind]], stdin=subprocess.PIPE, stdout=subprocess.PIPE
) as process:
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(bytes.fromhex("1f7f801fff"))
    process.stdin.flush()
    print(process.stdout.read(12)[2:6].hex())
    process.kill()

"""First contact with a CubeStar, step by step: python bringup.py TARGET.

TARGET is a serial port, tcp://HOST:PORT or rfc2217://HOST:PORT, of a real board or an emulated one
(cubestack emulate cubestar --pty ./ttyCUBESTAR). Ends with 1 at the first step that fails.
"""

import sys

from cubestack.firmware_model.interface.cubestar import INTERFACE
from cubestack.host.clients.cubestar.client import CubeStar
from cubestack.host.clients.node import NodeClient
from cubestack.host.transport.streams import open_transport


def step(number: int, text: str, good: bool) -> None:
    """Say how a step went; the first bad one ends the program."""
    print(f"{number} {'ok  ' if good else 'FAIL'} {text}")
    if not good:
        sys.exit(1)


with NodeClient(open_transport(sys.argv[1], INTERFACE.baud), INTERFACE) as client:
    cubestar = CubeStar(client)

    identity = client.telemetry("Identification")
    same = identity["InterfaceVersion"] == INTERFACE.version
    step(1, f"node type {identity['NodeType']}, interface {identity['InterfaceVersion']}", same)

    client.command("Reset")
    client.wait_processed(10)
    raised = [name for name, value in client.telemetry("ErrorFlags").items() if value]
    step(2, f"error flags after a reset: {', '.join(raised) or 'none'}", not raised)

    cubestar.capture()
    times = cubestar.phase_times()
    step(3, f"picture stored in {times['capture']:.0f} ms", times["capture"] < 1000)
    step(4, f"picture transferred in {times['transfer']:.0f} ms", times["transfer"] < 1000)

    status = cubestar.process_image()
    detected = client.telemetry("DetectionSummary")["NumStarsDetected"]
    step(5, f"{detected} stars, {status.name}", status.name == "CALCULATED")

    attitude = cubestar.attitude()
    pointing = f"right ascension {attitude.ra_deg:.3f}, declination {attitude.dec_deg:.3f} deg"
    step(6, f"{attitude.matched} matched, {pointing}", attitude.valid)

"""First contact with a CubeStar, step by step: python bringup.py TARGET.

TARGET is a serial port, tcp://HOST:PORT or rfc2217://HOST:PORT, of a real board or an emulated one
(cubestack emulate cubestar --pty ./ttyCUBESTAR). The exit status is 1 if a step fails.
"""

import sys

import cubestack


def step(number: int, text: str, good: bool) -> None:
    """Print the result of a step; exit if it failed."""
    print(f"{number} {'ok  ' if good else 'FAIL'} {text}")
    if not good:
        sys.exit(1)


if len(sys.argv) != 2:
    sys.exit("usage: python bringup.py TARGET")

with cubestack.connect(sys.argv[1], "cubestar") as cubestar:
    client = cubestar.client
    interface = client.interface

    identity = client.telemetry("Identification")
    same = identity["InterfaceVersion"] == interface.version
    step(1, f"node type {identity['NodeType']}, interface {identity['InterfaceVersion']}", same)

    client.command("Reset")
    client.wait_processed(10)
    raised = [name for name, value in client.telemetry("ErrorFlags").items() if value]
    step(2, f"error flags after a reset: {', '.join(raised) or 'none'}", not raised)

    cubestar.capture()
    times = cubestar.phase_times()
    step(3, f"image stored in {times['capture']:.0f} ms", times["capture"] < 1000)
    step(4, f"image transferred in {times['transfer']:.0f} ms", times["transfer"] < 1000)

    status = cubestar.process_image()
    detected = client.telemetry("DetectionSummary")["NumStarsDetected"]
    step(5, f"{detected} stars, {status.name}", status.name == "CALCULATED")

    attitude = cubestar.attitude()
    pointing = f"right ascension {attitude.ra_deg:.3f}, declination {attitude.dec_deg:.3f} deg"
    step(6, f"{attitude.matched} matched, {pointing}", attitude.valid)

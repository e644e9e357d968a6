import socket
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest

TIMEOUT_S = 60
EXAMPLE = Path(__file__).parents[2] / "examples" / "plain_pyserial.py"


def run_against(uart: Any) -> "subprocess.CompletedProcess[str]":
    """Runs the example on a socket that ``uart`` answers."""

    def serve(server: socket.socket) -> None:
        connection = server.accept()[0]
        connection.settimeout(TIMEOUT_S)
        with connection:
            while data := connection.recv(1000):
                uart.write(data)
                connection.sendall(uart.read(1000, 0.0))

    with socket.create_server(("127.0.0.1", 0)) as server:
        server.settimeout(TIMEOUT_S)  # a program that never calls must not keep the thread
        thread = threading.Thread(target=serve, args=(server,))
        thread.start()
        target = f"socket://127.0.0.1:{server.getsockname()[1]}"
        result = subprocess.run(
            [sys.executable, str(EXAMPLE), target],
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
        )
        thread.join(TIMEOUT_S)
    return result


@pytest.mark.parametrize("qbar0", [0.1, 0.7967])  # the second is 1F 1F on the wire
def test_prints_the_attitude(uart: Any, node: Any, qbar0: float) -> None:
    node.values["TaskStatus"] = {"taskStatus": 29}
    node.values["AttitudeData"] = {"Qbar0": qbar0, "Qbar3": -0.6044}
    node.values["AttitudeData"] |= {"RightAscension": -3.1, "Declination": 1.5}
    node.values["AttitudeData"]["BSVZ"] = 0.7967  # ends in 1F 1F, right before the frame's end
    result = run_against(uart)
    assert result.returncode == 0, result.stderr
    assert result.stdout == (
        f"quaternion {qbar0:+.4f} +0.0000 +0.0000 -0.6044\n"
        "right ascension -3.1000 rad, declination +1.5000 rad\n"
    )
    assert [name for name, _ in node.log] == ["CaptureAndProcess"]


def test_driver_reports_an_image_without_attitude(uart: Any, node: Any) -> None:
    node.values["TaskStatus"] = {"taskStatus": 25}
    result = run_against(uart)
    assert (result.returncode, result.stderr) == (1, "no attitude in this image\n")

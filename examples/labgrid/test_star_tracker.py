"""labgrid's fixture ``target`` with a star tracker: pytest --lg-env environment.yaml"""

import pytest

START, END = b"\x1f\x7f", b"\x1f\xff"


@pytest.fixture
def port(target):
    return target.get_driver("SerialDriver")


def request(port, message: bytes) -> bytes:
    """The answer's content; no byte of these messages is a 1F."""
    port.write(START + message + END)
    answer = b""
    while not answer.endswith(END):
        answer += port.read(1, timeout=10)
    return answer.removeprefix(START).removesuffix(END)


def test_identifies_itself(port):
    node_type, interface = request(port, b"\x80")[:2]
    assert (node_type, interface) == (5, 3)


def test_stores_detection_thresholds(port):
    request(port, b"\x15\x20\x21")
    assert request(port, b"\x92") == b"\x00\x20\x21"

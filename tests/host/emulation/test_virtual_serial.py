from typing import Any

import pytest

from cubestack.host.emulation.virtual_serial import VirtualSerial

PS_PER_S = 10**12


class Line:
    """Bytes that come at their times; time passes while somebody reads.

    Attributes:
        coming: (s, bytes), rising.
    """

    def __init__(self, *coming: tuple[float, bytes]) -> None:
        self.coming = list(coming)
        self.now_ps = 5 * PS_PER_S
        self.said = b""

    def read(self, max_bytes: int, timeout_s: float) -> bytes:
        late_ps = self.now_ps + round(timeout_s * PS_PER_S)
        if not self.coming or (at_ps := round(self.coming[0][0] * PS_PER_S)) > late_ps:
            self.now_ps = late_ps
            return b""
        self.now_ps = max(self.now_ps, at_ps)
        return self.coming.pop(0)[1]

    def write(self, data: bytes) -> None:
        self.said += data

    def close(self) -> None:
        pass

    @property
    def now_s(self) -> float:
        return self.now_ps / PS_PER_S


def opened(line: Line, timeout: float | None) -> VirtualSerial:
    port: Any = VirtualSerial(line, 57_600)  # type: ignore[arg-type]
    port.timeout = timeout
    return port  # type: ignore[no-any-return]


COMING = ((5.25, b"ab"), (5.5, b"cd\n"), (8.0, b"e"))


@pytest.mark.parametrize(
    ("timeout", "reads"),
    [
        (1.0, [(3, b"abc", 5.5), (2, b"d\n", 5.5)]),
        (1.0, [(9, b"abcd\n", 6.0), (1, b"", 7.0)]),
        (None, [(6, b"abcd\ne", 8.0)]),
        (0.0, [(3, b"", 5.0)]),
        (0.3, [(3, b"ab", 5.3), (1, b"c", 5.5), (2, b"d\n", 5.5)]),
    ],
)
def test_read_returns_after_its_last_byte_or_the_timeout(timeout: Any, reads: Any) -> None:
    line = Line(*COMING)
    port = opened(line, timeout)
    for size, found, until_s in reads:
        assert port.read(size) == found
        assert line.now_s == pytest.approx(until_s)
    assert port.in_waiting == 0


def test_readline_stops_at_the_newline() -> None:
    line = Line(*COMING)
    port = opened(line, 1.0)
    assert port.readline() == b"abcd\n"
    assert line.now_s == 5.5
    assert port.readline() == b""
    assert line.now_s == pytest.approx(6.5)
    assert port.timeout == 1.0
    assert opened(Line((900.0, b"x\n")), None).readline() == b"x\n"


@pytest.mark.parametrize(
    ("expected", "size", "found"),
    [(b"bc", None, b"abc"), (b"\n", 2, b"ab"), (b"x", 4, b"abcd"), (b"x", None, b"abcd\n")],
)
def test_read_until_stops_at_text_size_or_timeout(
    expected: bytes, size: int | None, found: bytes
) -> None:
    assert opened(Line(*COMING), 1.0).read_until(expected, size) == found


@pytest.mark.parametrize(("size", "found"), [(-1, b"abcd\n"), (0, b""), (2, b"ab")])
def test_readline_has_a_maximum_size(size: int, found: bytes) -> None:
    assert opened(Line(*COMING), 1.0).readline(size) == found


def test_timeout_0_returns_at_once() -> None:
    line = Line((5.0, b"ab"), (5.1, b"c"))
    port = opened(line, 0.0)
    assert port.read(3) == b"ab"
    assert port.in_waiting == 0
    assert line.now_s == 5.0


def test_write_returns_the_number_of_bytes() -> None:
    line = Line()
    assert opened(line, 0.0).write(bytearray(b"abc")) == 3
    assert line.said == b"abc"

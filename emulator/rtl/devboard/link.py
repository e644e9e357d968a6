"""Requests to a development board and their responses, each executed once on a line with errors.

Both directions keep the order of the bytes. So when something is missing or damaged, the answer to
a request with an unused number says definitely which request the board waits for: all that were
sent before it have arrived or are lost. Responses of executed requests are fetched again by short
requests with their numbers; the others are sent again.
"""

import secrets
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from time import monotonic
from typing import NamedTuple

from cubestack.emulator.rtl.devboard.channel import Channel, DevboardError
from cubestack.firmware_model.interface.devboard import (
    BUFFER,
    CHAINED,
    LONGEST_REQUEST,
    OPERATIONS,
    WINDOW,
    Code,
    Frame,
    FrameDecoder,
    Identity,
    ProtocolError,
    Response,
    Status,
    buffered,
    encode_frame,
)

GIVE_UP_S = 10.0
"""Time without a valid frame after which a board hangs."""

HELLO_S, HELLOS = 0.25, 4
"""Time to wait for the response of a HELLO, and number of attempts."""

RATES = (115_200, 230_400, 460_800, 921_600, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 12_000_000)
"""Rates that are tried to find a board that does not answer."""

SHORTEST_LIMIT = 64
"""Bytes of the longest request on the worst line."""

GOOD = 64
"""Requests without an error after which longer ones are tried again."""

_UNUSED = 128  # distance of numbers that are in nobody's window


class Request(NamedTuple):
    """An operation; a chained one is executed only if all before it ended with OK."""

    code: Code
    payload: bytes = b""
    chained: bool = False


@dataclass
class Counters:
    """What the line cost.

    Attributes:
        frames: sent, repetitions included.
        repeated: requests or responses that were sent again.
        damaged: pieces received that are no frame.
        sent, received: bytes.
    """

    frames: int = 0
    repeated: int = 0
    damaged: int = 0
    sent: int = 0
    received: int = 0


class _Sent(NamedTuple):
    number: int
    request: Request


class Link:
    """A board behind a channel.

    Attributes:
        identity: what the board says it is; set by ``open``.
        limit: bytes of a request at most; shorter on a line that damages frames.
    """

    def __init__(self, channel: Channel) -> None:
        self.channel = channel
        self.counters = Counters()
        self.identity: Identity | None = None
        self.limit = LONGEST_REQUEST
        self._window, self._buffer = WINDOW, BUFFER
        self._decoder = FrameDecoder()
        self._number = 0  # of the next request
        self._waiting: deque[_Sent] = deque()
        self._early: dict[int, Response] = {}  # responses that overtook a lost one
        self._trouble = False  # something was damaged or is missing
        self._silent_s = 0.0  # since the last frame
        self._patience_s = 0.2
        self._longest = LONGEST_REQUEST
        self._good = 0  # requests since the limit was changed
        self._probes: set[int] = set()  # numbers of unused requests
        self._probed = 0

    @property
    def name(self) -> str:
        return self.channel.name

    def open(self, baud: int) -> bytes:
        """Say HELLO; returns the outputs. DevboardError says why there is no answer."""
        received = self.counters.received
        outputs = self._hello(HELLOS)
        if outputs is not None:
            return outputs
        heard = self.counters.received - received
        for rate in RATES:
            if rate != baud and self.channel.set_baud(rate) and self._hello(1) is not None:
                raise DevboardError(
                    f"the board on {self.name} answers at {rate} baud, not at {baud}; add @{rate}"
                )
        if heard:
            raise DevboardError(
                f"the board on {self.name} sent {heard} bytes that are no answer; another program"
                " or bitstream runs on it: write that of `cubestack hdl board`"
            )
        raise DevboardError(
            f"the board on {self.name} does not answer; check power and port, and write the"
            " bitstream of `cubestack hdl board`"
        )

    def _hello(self, attempts: int) -> bytes | None:
        for _ in range(attempts):
            self._silent_s = 0.0
            nonce = secrets.token_bytes(4)
            payload = OPERATIONS[Code.HELLO].request(nonce=int.from_bytes(nonce, "little"))
            self._transmit(Frame(0, Code.HELLO, payload))
            until = monotonic() + 4 * HELLO_S  # something else may send all the time
            while not self._silent_s and monotonic() < until:
                for frame in self._receive(HELLO_S):
                    if frame.code != Status.OK or frame.payload[2:6] != nonce:
                        continue
                    try:
                        self.identity = Identity.parse(frame.payload[6:])
                    except ProtocolError as error:
                        raise DevboardError(f"board on {self.name}: {error}") from None
                    self._window, self._buffer = self.identity.window, self.identity.buffer
                    self.limit = self._longest = self.identity.longest
                    self._number, self._trouble = 1, False
                    return frame.payload[6 + Identity.SIZE :]
        return None

    def exchange(self, requests: Iterable[Request]) -> Iterator[Response]:
        """Responses in order; several requests are on their way at once.

        Ends after the first response that is not OK: requests taken from ``requests`` by then must
        be chained, so they are not executed. Ends early also when the next request is longer than
        ``limit`` has become; it was not executed. The caller must take all responses.
        """
        source = iter(requests)
        ready: deque[Request] = deque()
        over = False
        while True:
            while not over and len(self._waiting) < self._window:
                if not ready:
                    ready.extend(islice(source, 1))
                if not ready or not self._fits(ready[0]):
                    break
                self._send(ready.popleft())
            if not self._waiting:
                return
            again = self._await_oldest()
            ready.extendleft(reversed(again))
            if again and len(again[0].payload) > self.limit:
                over = True
            if not self._waiting:
                continue
            response = self._early.pop(self._waiting.popleft().number)
            if not over or response.status is not Status.SKIPPED:
                over |= response.status is not Status.OK
                yield response

    def request(self, code: Code, payload: bytes = b"") -> Response:
        """One request; never one longer than ``SHORTEST_LIMIT``."""
        (response,) = self.exchange([Request(code, payload)])
        return response

    def close(self) -> None:
        self.channel.close()

    def _fits(self, request: Request) -> bool:
        held = sum(buffered(len(sent.request.payload)) for sent in self._waiting)
        return not self._waiting or held + buffered(len(request.payload)) <= self._buffer

    def _send(self, request: Request) -> None:
        sent = _Sent(self._number, request)
        self._number = (self._number + 1) % 256
        self._waiting.append(sent)
        code = request.code | (CHAINED if request.chained else 0)
        self._transmit(Frame(sent.number, code, request.payload))

    def _transmit(self, frame: Frame) -> None:
        data = encode_frame(frame)
        self.counters.frames += 1
        self.counters.sent += len(data)
        self.channel.write(data)

    def _receive(self, timeout_s: float) -> list[Frame]:
        """Frames that arrived; none after the time-out, and perhaps none in damaged bytes."""
        data = self.channel.read(timeout_s)
        self.counters.received += len(data)
        before = self._decoder.damaged
        frames = self._decoder.feed(data)
        self.counters.damaged += self._decoder.damaged - before
        self._trouble |= not data or self._decoder.damaged > before
        if frames:
            self._silent_s = 0.0
        elif not data:
            self._silent_s += timeout_s
            if self._silent_s >= GIVE_UP_S:
                raise DevboardError(
                    f"the board on {self.name} has not answered for {GIVE_UP_S:g} s: it hangs, or"
                    f" the cable is broken ({self.counters.repeated} repetitions before)"
                )
        return frames

    def _await_oldest(self) -> list[Request]:
        """Wait for the response of the oldest request; returns those that were not executed.

        They are no longer waiting, perhaps the oldest one too.
        """
        again: list[Request] = []
        begin = monotonic()
        while self._waiting and self._waiting[0].number not in self._early:
            self._sort(self._receive(self._patience_s))
            if self._trouble:
                again = self._recover() + again
        self._patience_s += (0.05 + 4 * (monotonic() - begin) - self._patience_s) / 8
        self._good += 1
        if self._good > GOOD and not again:
            self.limit, self._good = min(2 * self.limit, self._longest), 0
        return again

    def _sort(self, frames: Iterable[Frame]) -> int | None:
        """Keep the responses that are waited for; returns what the answer to a probe says."""
        waiting = {sent.number for sent in self._waiting}
        expected = None
        for frame in frames:
            try:
                response = Response.parse(frame.code, frame.payload)
            except ProtocolError as error:
                raise DevboardError(f"board on {self.name}: {error}") from None
            if response.status is Status.CLOSED:
                raise DevboardError(
                    f"the board on {self.name} was restarted in the middle; its state is lost"
                )
            if response.status is not Status.NAK:
                if frame.number in waiting:
                    self._early[frame.number] = response
            elif response.done in self._probes:
                expected = frame.number
            else:
                self._trouble = True
        return expected

    def _recover(self) -> list[Request]:
        """Fetch lost responses; returns the requests that were not executed."""
        expected = self._probe()
        executed = [s for s in self._waiting if (expected - s.number - 1) % 256 < _UNUSED]
        again = [sent.request for sent in list(self._waiting)[len(executed) :]]
        self._waiting, self._number = deque(executed), expected
        self.counters.repeated += len(again)
        if again and (size := len(again[0].payload)) > SHORTEST_LIMIT:
            self.limit, self._good = max(SHORTEST_LIMIT, min(self.limit, size) // 2), 0
        for sent in executed:
            while sent.number not in self._early:
                self.counters.repeated += 1
                self._transmit(Frame(sent.number, Code.OUTPUTS))
                while sent.number not in self._early:
                    frames = self._receive(self._patience_s)
                    self._sort(frames)
                    if not frames:
                        break
        self._trouble = False
        return again

    def _probe(self) -> int:
        """The number of the request that the board waits for, after all that was sent."""
        self._probes = set()
        while True:
            self._probed = (self._probed + 1) % 64
            number = (self._waiting[0].number + _UNUSED + self._probed) % 256
            self._probes.add(number)
            self._transmit(Frame(number, Code.OUTPUTS))
            while frames := self._receive(self._patience_s):
                if (expected := self._sort(frames)) is not None:
                    return expected

"""The bridge in gateware against the reference model, bit by bit on its serial line."""

from random import Random

import pytest

from cubestack.emulator.rtl.board_model.board import SimulatedBoard
from cubestack.firmware_model.interface.devboard import (
    BUFFER,
    OPERATIONS,
    WINDOW,
    Code,
    Frame,
    FrameDecoder,
    Response,
    Status,
    Step,
    buffered,
    encode_frame,
)
from tests.hdl.devboard import exchange
from tests.hdl.devboard.exchange import Line, Request, compare, hello, random_requests

RUN = OPERATIONS[Code.RUN]


@pytest.fixture
def board() -> SimulatedBoard:
    return exchange.rtl_board()


def opened(board: SimulatedBoard) -> SimulatedBoard:
    board.receive(encode_frame(Frame(255, *hello())))
    return board


@pytest.mark.parametrize(
    "seed", [1, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 12))]
)
def test_random_requests_get_the_responses_of_the_model(board: SimulatedBoard, seed: int) -> None:
    model = exchange.model()
    start = encode_frame(Frame(255, *hello(seed)))
    assert model.receive(start) == board.receive(start)
    random = Random(seed)
    assert compare(model, board, random_requests(random, 250, model), random) == 250


def test_a_board_without_hello_executes_nothing(board: SimulatedBoard) -> None:
    (frame,) = FrameDecoder().feed(board.receive(encode_frame(Frame(0, Code.OUTPUTS))))
    assert frame.code == Status.CLOSED


def test_window_of_the_longest_requests_fits_into_the_buffer(board: SimulatedBoard) -> None:
    opened(board)
    longest = BUFFER // 3 - buffered(0)
    requests = [Frame(n, Code.STEPS, bytes([Step.SET | 1, n]) * (longest // 2)) for n in range(3)]
    requests += [Frame(n, Code.OUTPUTS) for n in range(3, WINDOW)]
    sent = b"".join(map(encode_frame, requests[:3]))
    assert len(sent) > 2000
    answers = FrameDecoder().feed(board.receive(sent))
    assert [(frame.number, frame.code) for frame in answers] == [(n, Status.OK) for n in range(3)]


def test_2000_bytes_in_one_piece_lose_nothing(board: SimulatedBoard) -> None:
    opened(board)
    payload = bytes([Step.SET | 1, 0x55, Step.SET | 1, 0xAA]) * 60
    sent = b"".join(encode_frame(Frame(n, Code.STEPS, payload)) for n in range(WINDOW + 1))
    answers = FrameDecoder().feed(board.receive(sent))
    assert len(sent) > 2000
    done = [Response.parse(frame.code, frame.payload).done for frame in answers]
    assert done == [120] * (WINDOW + 1)


def test_what_does_not_fit_into_the_buffer_is_refused_and_can_be_repeated(
    board: SimulatedBoard,
) -> None:
    opened(board)
    long = encode_frame(
        Frame(0, Code.RUN, RUN.request(camera=0, memory=0, line=0, pixel=0, clocks=32767))
    )
    fill = [encode_frame(Frame(n, Code.STEPS, bytes([1, n]) * 600)) for n in range(1, WINDOW)]
    answers = FrameDecoder().feed(board.receive(long + b"".join(fill)))
    codes = [frame.code for frame in answers]
    assert codes[:4] == [Status.OK] * 4
    assert set(codes[4:]) == {Status.NAK}
    (again,) = FrameDecoder().feed(board.receive(fill[3]))
    assert (again.number, again.code) == (4, Status.OK)


def test_one_percent_of_damaged_bytes_loses_nothing_and_repeats_nothing(
    board: SimulatedBoard,
) -> None:
    opened(board)
    model, random = exchange.model(), Random(7)
    line, perfect = Line(board, Random(8), 0.01), Line(model, Random(9), 0)
    assert line.request(hello()).payload == perfect.request(hello()).payload
    for request in random_requests(random, 300, model):
        if request.code & 0x7F != Code.HELLO:
            assert line.request(request)[1:] == perfect.request(request)[1:]
    assert line.repeated > 30
    assert perfect.repeated == 0


def test_deviations_that_fill_a_response_end_the_operation(board: SimulatedBoard) -> None:
    opened(board)
    random = Random(3)
    payload = b"".join(bytes([Step.SET | 2, value]) for value in (4, 12, 4, 12) * 40)
    line = Line(board, random, 0)
    line.request(hello())
    frame = line.request(Request(Code.STEPS, payload))
    response = Response.parse(frame.code, frame.payload)
    assert response.status == Status.FULL
    assert 0 < response.done < 160

import pytest

from cubestack.firmware_model.cubesense.jobs import Background, JobQueue, Measure
from cubestack.firmware_model.interface.cubesense.codes import Camera, Sram
from cubestack.firmware_model.mcu.requests import Pay, Routine
from cubestack.firmware_model.node.commands import QUEUE_DEPTH


def nothing() -> Routine[None]:
    yield Pay()


def measure(number: int) -> Measure:
    return Measure(Camera(number % 2), Sram(number // 2 % 2), detect=True)


def test_jobs_come_in_order_and_before_streams() -> None:
    queue = JobQueue()
    one, two = Background(nothing), Background(nothing)
    queue.request(one)
    assert queue.put(measure(0))
    queue.request(two)
    assert queue.put(measure(1))
    assert not queue.request(one)  # waits already
    assert len(queue) == 4
    assert [queue.pop() for _ in range(4)] == [measure(0), measure(1), one, two]
    assert not queue
    with pytest.raises(IndexError):
        queue.pop()


def test_a_stream_may_go_on_before_another() -> None:
    queue = JobQueue()
    one, two = Background(nothing), Background(nothing)
    queue.request(one)
    queue.request(two, next_turn=True)
    assert [queue.pop(), queue.pop()] == [two, one]


def test_four_jobs_wait_and_streams_do_not_count() -> None:
    queue = JobQueue()
    queue.request(Background(nothing))
    accepted = [queue.put(measure(number)) for number in range(QUEUE_DEPTH + 1)]
    assert accepted == [True] * QUEUE_DEPTH + [False]
    assert queue.full
    assert queue.pop() == measure(0)
    assert not queue.full

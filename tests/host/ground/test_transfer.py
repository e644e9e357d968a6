import threading

import numpy as np
import pytest

from cubestack.host.clients.contract import Progress
from cubestack.host.ground.transfer import Transfer, grey_values
from cubestack.host.pictures.images import png

SOON_S = 30.0


class Sender:
    """Sends a picture in blocks, each released by ``let``; ``sent`` signals each block."""

    def __init__(self) -> None:
        self.let, self.sent = threading.Semaphore(0), threading.Semaphore(0)
        self.picture = np.arange(12, dtype=np.uint8).reshape(3, 4)
        self.count = 0

    def __call__(self, progress: Progress) -> np.ndarray:
        for done in (1, 2, 3):
            assert self.let.acquire(timeout=SOON_S)
            self.count = done
            self.sent.release()
            progress(done, 3)
        return self.picture


def started(transfer: Transfer) -> threading.Thread:
    thread = threading.Thread(target=transfer.run)
    thread.start()
    return thread


def test_transfer_reports_progress_and_result() -> None:
    sender = Sender()
    transfer = Transfer("download", sender)
    assert (transfer.state["done"], transfer.state["ended"]) == (0, "")
    sender.let.release(3)
    started(transfer).join(SOON_S)
    assert not transfer.runs
    assert transfer.state == {
        **{"what": "download", "done": 3, "total": 3, "paused": False},
        **{"ended": "done", "saved": True},
    }
    assert transfer.picture is not None
    assert np.array_equal(grey_values(transfer.picture), sender.picture)


def test_held_transfer_pauses() -> None:
    sender = Sender()
    transfer = Transfer("download", sender)
    transfer.pause()
    thread = started(transfer)
    sender.let.release(3)
    assert transfer.state["paused"]
    assert not sender.sent.acquire(timeout=0.05)  # not even the first one
    transfer.resume()
    thread.join(SOON_S)
    assert (transfer.state["ended"], sender.count) == ("done", 3)


@pytest.mark.parametrize("held", [False, True])
def test_cancelled_transfer_ends_after_a_block(held: bool) -> None:
    sender = Sender()
    transfer = Transfer("download", sender)
    thread = started(transfer)
    sender.let.release(1)
    assert sender.sent.acquire(timeout=SOON_S)
    if held:
        transfer.pause()
    transfer.cancel()
    sender.let.release(2)
    thread.join(SOON_S)
    assert transfer.state["ended"].startswith("cancelled after ")
    assert transfer.picture is None
    assert sender.count < 3


def test_upload_rejects_data_that_is_no_image() -> None:
    with pytest.raises(ValueError, match="the uploaded file is not a picture"):
        grey_values(b"GIF89a and no more")
    assert np.array_equal(grey_values(png(np.eye(3, dtype=np.uint8))), np.eye(3))

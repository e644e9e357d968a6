"""Logs of a device's results over time, and their scatter.

CubeStar thesis, appendix A (an interface that polls and stores attitudes) and section 6.1: a
straight line fitted to the logged angles replaces the truth; the residuals are the errors.
"""

from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from itertools import count as counted

import numpy as np

from cubestack.host.clients.contract import Columns, DeviceClient
from cubestack.host.errors import NodeError

ANGLE = "_deg"
IMAGE_TIME = "image_time_s"


def log_lines(
    client: DeviceClient,
    clock: Callable[[], float],
    *,
    count: int | None = None,
    interval_s: float = 1.0,
    before_each: Callable[[], None] = lambda: None,
) -> Iterator[Columns]:
    """The device's latest result, polled; each as a line of the log.

    Args:
        client: of the device.
        clock: time in s on the device's side, which ``client`` lets pass.
        count: number of lines; None for no end.
        interval_s: from one line to the next; later ones follow at once when that is too short.
        before_each: done before each line, in its time.

    Yields:
        ``time_s`` since the first line, ``utc`` by this computer's clock, ``error`` in place of the
        result when the node did not answer rightly, and ``DeviceClient.latest``.
    """
    start = clock()
    for number in range(count) if count is not None else counted():
        client.client.pause(max(0.0, start + number * interval_s - clock()))
        utc = datetime.now(UTC).isoformat(timespec="milliseconds")
        begun: Columns = {"time_s": round(clock() - start, 6), "utc": utc}
        try:
            before_each()
            yield {**begun, "error": None, **client.latest()}
        except NodeError as error:
            yield {**begun, "error": str(error)}


def scatter(lines: Sequence[Columns]) -> dict[str, tuple[float, float, int]]:
    """Trend of each angle by its column: (deg/s, standard deviation in deg, number of lines).

    Of the straight line through it, whatever turns it makes, and of what is left; by the time of
    the images if the device reports it. Angles with less than three values are left out.
    """
    found = {}
    for column in dict.fromkeys(name for line in lines for name in line if name.endswith(ANGLE)):
        points = [
            (line.get(IMAGE_TIME, line["time_s"]), line[column])
            for line in lines
            if line.get(column) is not None
        ]
        times, angles = np.array(points, np.float64).reshape(-1, 2).T
        if len(set(times)) > 2:
            whole = np.unwrap(angles, period=360.0)
            slope, offset = np.polyfit(times - times[0], whole, 1)
            left = whole - slope * (times - times[0]) - offset
            found[column] = float(slope), float(left.std()), len(whole)
    return found

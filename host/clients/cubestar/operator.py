"""What a ground operator does by hand: find a detection threshold for a new sky.

CubeStar thesis, section 5.3.3: a threshold of 6 suits semi-urban skies; brighter ones need a higher
one. Section 5.3.4 says what shows a good one: the weights are similar, and close to the maximum.
Only telecommands and telemetry are used.
"""

from collections.abc import Iterable

from cubestack.firmware_model.interface.cubestar import IdMode
from cubestack.host.clients.cubestar.client import CubeStar

#: Thresholds in DN that are tried, about a quarter apart where that is more than one.
LADDER = (1, 2, 3, 4, 5, 6, 8, 10, 13, 16, 20, 25, 32, 40, 50, 63, 80, 100, 125, 160, 200)


def find_threshold(cubestar: CubeStar, views: Iterable[object] = (None,)) -> int | None:
    """Process pictures with each threshold, lost in space, and set the best one, in DN.

    The best is the one by which most stars are identified that confirm each other, the higher one
    in a tie. A picture is captured as soon as ``views`` gives something, so it can point elsewhere.
    Returns None, and leaves the setting as it was, when none gives an attitude.
    """
    client = cubestar.client
    before = client.telemetry("DetectionThresholdValues")
    agreeing = dict.fromkeys(LADDER, 0)
    for _ in views:
        cubestar.capture()
        for threshold in LADDER:
            _set(cubestar, threshold, threshold)
            client.command("setIDMode", IdMode=IdMode.LOST_IN_SPACE)
            cubestar.process_image()
            attitude = cubestar.attitude()
            if attitude.valid:
                most_votes = int(client.telemetry("MatchSummary")["MaxVotes"])
                agreeing[threshold] += min(attitude.matched, most_votes + 1)
    best = max(LADDER, key=lambda threshold: (agreeing[threshold], threshold))
    if not agreeing[best]:
        _set(cubestar, int(before["DetectionThreshold"]), int(before["StarThreshold"]))
        return None
    _set(cubestar, best, best)
    return best


def _set(cubestar: CubeStar, detection: int, star: int) -> None:
    cubestar.client.command(
        "setDetectionThresholds", DetectionThreshold=detection, StarThreshold=star
    )

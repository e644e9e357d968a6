"""A ground operator's procedure: find a detection threshold for a new sky.

CubeStar thesis, section 5.3.3: a threshold of 6 suits semi-urban skies; brighter ones need a higher
one. Section 5.3.4: with a good one the weights are similar, and close to the maximum. It uses only
telecommands and telemetry.
"""

from collections.abc import Iterable

from cubestack.firmware_model.interface.cubestar import IdMode
from cubestack.host.clients.cubestar.client import CubeStar

#: Thresholds to try in DN, about a quarter apart but at least one.
LADDER = (1, 2, 3, 4, 5, 6, 8, 10, 13, 16, 20, 25, 32, 40, 50, 63, 80, 100, 125, 160, 200)


def find_threshold(cubestar: CubeStar, views: Iterable[object] = (None,)) -> int | None:
    """Process images with each threshold, lost in space, and set the best; returns it in DN.

    The best identifies most stars that confirm each other; a tie goes to the higher one. An image
    is captured at each step of ``views``, which can change the pointing. Returns None, and restores
    the setting, if none gives an attitude.
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

"""What a ground operator does by hand: find a detection threshold for a new sky.

CubeStar thesis, section 5.3.3: a threshold of 6 suits semi-urban skies; brighter ones need a higher
one. Only telecommands and telemetry are used.
"""

from cubestack.host.clients.cubestar.client import CubeStar

#: Thresholds in DN that are tried, about a quarter apart where that is more than one.
LADDER = (1, 2, 3, 4, 5, 6, 8, 10, 13, 16, 20, 25, 32, 40, 50, 63, 80, 100, 125, 160, 200)


def find_threshold(cubestar: CubeStar) -> int | None:
    """Capture once, process the picture with each threshold, and set the best one, in DN.

    The best is the one by which most stars are identified, the higher one in a tie. Returns None,
    and leaves the setting as it was, when none gives an attitude.
    """
    client = cubestar.client
    before = client.telemetry("DetectionThresholdValues")
    cubestar.capture()
    best, most = None, 0
    for threshold in LADDER:
        _set(cubestar, threshold, threshold)
        cubestar.process_image()
        attitude = cubestar.attitude()
        if attitude.valid and attitude.matched >= most:
            best, most = threshold, attitude.matched
    if best is None:
        _set(cubestar, int(before["DetectionThreshold"]), int(before["StarThreshold"]))
    else:
        _set(cubestar, best, best)
    return best


def _set(cubestar: CubeStar, detection: int, star: int) -> None:
    cubestar.client.command(
        "setDetectionThresholds", DetectionThreshold=detection, StarThreshold=star
    )

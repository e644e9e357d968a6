"""Frame and exposure times of the MLX75412 from its registers, in line times.

CubeStar thesis, appendix C (equation C.0.1, figure C.1) and appendix D (table D.2). A line is 1322
input clocks. The lowest frame rate, one frame in 5 413 590 clocks, is 4095 lines: so a frame is a
whole number of lines. The rate registers assume the clock that CLOCKS_PER_SECOND says, whatever
crystal there is.
"""

from cubestack.firmware_model.interface.cameras.mlx75412 import LINE_CLOCKS, LONGEST_EXPOSURE, ROWS

__all__ = ["LINE_CLOCKS", "MOST_FRAME_LINES", "exposure_lines", "frame_lines"]

MOST_FRAME_LINES = 4095
FEWEST_FRAME_LINES = ROWS + 8
"""Shortest vertical blanking: assumed, far below what 30 frames a second leave."""


def frame_lines(clocks_per_second: int, frames_per_second: int) -> int:
    """Line times from one frame to the next, the nearest whole number (assumed) in range."""
    if frames_per_second == 0:
        return MOST_FRAME_LINES
    clocks = 2 * frames_per_second * LINE_CLOCKS
    nearest = (2 * clocks_per_second + clocks // 2) // clocks
    return min(max(nearest, FEWEST_FRAME_LINES), MOST_FRAME_LINES)


def exposure_lines(rule: int, exposure: int, lines: int) -> int:
    """Line times of exposure within a frame of ``lines``.

    Args:
        rule: register EXPOSURE_RULE.
        exposure: register EXPOSURE.
        lines: line times of the frame; the longest exposure is one less.
    """
    if rule == LONGEST_EXPOSURE:
        return lines - 1
    return min(max(exposure, 1), lines - 1)

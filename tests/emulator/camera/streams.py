"""Segments, as an engine requests them of a camera."""

from typing import Any

from cubestack.emulator.camera.common.stream import StreamSegment


def segments(camera: Any, start_ps: int, count: int) -> list[StreamSegment]:
    found = []
    for _ in range(count):
        segment = camera.segment_at(start_ps)
        found.append(segment)
        start_ps = segment.start_ps + int(segment.clocks * camera.period)
    return found

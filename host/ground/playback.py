"""A recording as a target: telemetry as last read before the playback position."""

import time
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

from cubestack.firmware_model.formats.recording import Recording, load_recording
from cubestack.firmware_model.interface.codec.field import Value
from cubestack.firmware_model.interface.codec.message import Interface, MessageKind
from cubestack.host.clients.contract import Client
from cubestack.host.devices.registry import device
from cubestack.host.errors import NoAnswerError, PortOpenError, TargetError
from cubestack.host.ground.emulation import JsonObject
from cubestack.host.recording.transcript import TranscriptEntry, transcript
from cubestack.host.targets import RECORDED, Target

SUFFIX = ".rec"


class PlaybackClient(Client):
    """Answers telemetry from a recording, in any order of requests.

    Attributes:
        end_s: time of the last message.
    """

    def __init__(
        self, recording: Recording, interface: Interface, now: Callable[[], float] = time.monotonic
    ) -> None:
        """Start at 0 s; ``now`` is the clock in s."""
        self.interface, self._now = interface, now
        self._entries = defaultdict[str, list[TranscriptEntry]](list)
        for one in transcript(recording, interface):
            if one.kind == MessageKind.TELEMETRY.value and one.values and not one.error:
                self._entries[one.name].append(one)
        self.end_s = recording.end_ps / 1e12
        self._at_s, self._since = 0.0, now()
        self._runs = True

    @property
    def time_s(self) -> float:
        """Position; it stops at the end."""
        elapsed_s = self._now() - self._since if self._runs else 0.0
        return min(self._at_s + elapsed_s, self.end_s)

    @property
    def state(self) -> JsonObject:
        return {"time_s": self.time_s, "end_s": self.end_s, "runs": self._runs}

    def play(self, to_s: float | None, runs: bool) -> None:
        """Jump to ``to_s`` if given; run or pause. Raises ValueError for a time outside of it."""
        if to_s is not None and not 0 <= to_s <= self.end_s:
            raise ValueError(f"a position must be 0 to {self.end_s:.6f} s, not {to_s}")
        self._at_s = self.time_s if to_s is None else to_s
        self._since, self._runs = self._now(), runs

    def telemetry(self, name: str) -> dict[str, Value]:
        """See ``Client``; raises NoAnswerError if it was not read before the position."""
        entries, at_s = self._entries[self._asked(name).name], self.time_s
        place = bisect_right(entries, at_s, key=lambda one: one.time_s)
        if not place:
            raise NoAnswerError(f"{name} was not read before {at_s:.3f} s of the recording")
        return dict(entries[place - 1].values)

    def command(self, name: str, **_parameters: object) -> None:
        """Raises TargetError."""
        raise TargetError(f"{name}: a recording accepts no telecommands")

    def pause(self, seconds: float) -> None: ...

    def close(self) -> None: ...


def is_recording(text: str) -> bool:
    """Whether a target is ``recorded:FILE`` or a file with its suffix."""
    return text.startswith(RECORDED) or text.endswith(SUFFIX)


def open_recording(text: str) -> Target:
    """Open the recording ``text`` as a target.

    Raises PortOpenError if it can not be opened, RecordingError for an invalid file, TargetError
    for an unknown device.
    """
    path = Path(text.removeprefix(RECORDED))
    try:
        recording = load_recording(path)
    except OSError as error:
        raise PortOpenError(f"can not open {path}: {error.strerror}") from error
    owner = device(recording.device)
    node = PlaybackClient(recording, owner.interface)
    name = f"{RECORDED}{path}"
    return Target(name, owner.interface, node, device=owner, recorded=path)

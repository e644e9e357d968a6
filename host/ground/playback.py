"""A recording as a target of a page: its telemetry as it was last read before a time that runs."""

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
    """Answers telemetry as a recording has it, whatever is asked in which order.

    Attributes:
        end_s: when the last thing was said.
    """

    def __init__(
        self, recording: Recording, interface: Interface, now: Callable[[], float] = time.monotonic
    ) -> None:
        """Begin at time 0; ``now`` is what goes on meanwhile, in s."""
        self.interface, self._now = interface, now
        self._told = defaultdict[str, list[TranscriptEntry]](list)
        for one in transcript(recording, interface):
            if one.kind == MessageKind.TELEMETRY.value and one.values and not one.error:
                self._told[one.name].append(one)
        self.end_s = recording.end_ps / 1e12
        self._at_s, self._since = 0.0, now()
        self._runs = True

    @property
    def time_s(self) -> float:
        """Where it is; it stays at the end."""
        gone = self._now() - self._since if self._runs else 0.0
        return min(self._at_s + gone, self.end_s)

    @property
    def state(self) -> JsonObject:
        return {"time_s": self.time_s, "end_s": self.end_s, "runs": self._runs}

    def play(self, to_s: float | None, runs: bool) -> None:
        """Go to a time, None: stay; then go on or hold. ValueError for a time that it has not."""
        if to_s is not None and not 0 <= to_s <= self.end_s:
            raise ValueError(f"the recording has 0 to {self.end_s:.6f} s, not {to_s}")
        self._at_s = self.time_s if to_s is None else to_s
        self._since, self._runs = self._now(), runs

    def telemetry(self, name: str) -> dict[str, Value]:
        """See ``Client``; NoAnswerError for what nobody had read by then."""
        told, at_s = self._told[self._asked(name).name], self.time_s
        place = bisect_right(told, at_s, key=lambda one: one.time_s)
        if not place:
            raise NoAnswerError(f"nobody had read {name} by {at_s:.3f} s of the recording")
        return dict(told[place - 1].values)

    def command(self, name: str, **_parameters: object) -> None:
        """Nothing can be told to a recording: TargetError."""
        raise TargetError(f"{name}: a recording takes no telecommand")

    def pause(self, seconds: float) -> None: ...

    def close(self) -> None: ...


def is_recording(text: str) -> bool:
    """Whether a target is one: ``recorded:FILE``, or a file that is called like one."""
    return text.startswith(RECORDED) or text.endswith(SUFFIX)


def open_recording(text: str) -> Target:
    """The recording that ``text`` names.

    Raises PortOpenError for no file, RecordingError for another file, TargetError for an unknown
    device.
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

"""What a page saves: all that was said, as a recording and as tables, and its log of results."""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from cubestack.firmware_model.formats.recording import load_recording
from cubestack.host.ground.results import FORMS
from cubestack.host.ground.session import TargetSession
from cubestack.host.recording.tables import TABLES
from cubestack.host.recording.transcript import transcript


def recording(session: TargetSession) -> bytes:
    """All that was said by now, in whole lines; ValueError where nothing is recorded.

    Raises the errors of its control port.
    """
    if session.controls is not None:
        return session.controls.client.fetch("GET", f"/devices/{session.controls.device}/recording")
    if session.target.recorded is None:
        raise ValueError(session.about["missing"]["recording"])
    content = session.target.recorded.read_bytes()
    return content[: content.rfind(b"\n") + 1]


def said_table(session: TargetSession, kind: str) -> bytes:
    """The table that `cubestack decode` makes of the recording: "csv" or "parquet".

    Raises as ``recording``; ValueError for another kind, and without pyarrow.
    """
    make: Callable[..., bytes] | None = TABLES.get(kind)
    if make is None:
        raise ValueError(f"no table {kind!r}; there are {', '.join(TABLES)}")
    content = recording(session)
    with TemporaryDirectory(prefix="cubestack-") as folder:
        path = Path(folder) / "said.rec"
        path.write_bytes(content)
        return make(transcript(load_recording(path), session.target.interface))


def results_table(session: TargetSession, kind: str) -> bytes:
    """Its log of results, "csv" or "parquet"; raises as ``said_table``."""
    if kind not in FORMS:
        raise ValueError(f"no table {kind!r}; there are {', '.join(FORMS)}")
    return FORMS[kind](session.log)

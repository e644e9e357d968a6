"""Files that a page saves: the recording, its transcript as a table, the log of results."""

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from cubestack.firmware_model.formats.recording import load_recording
from cubestack.host.ground.results import FORMS
from cubestack.host.ground.session import TargetSession
from cubestack.host.recording.transcript import TABLES, transcript


def recording(session: TargetSession) -> bytes:
    """The recording up to now, in whole lines.

    Raises ValueError if nothing is recorded, and the errors of its control port.
    """
    if session.controls is not None:
        return session.controls.client.fetch("GET", f"/devices/{session.controls.device}/recording")
    if session.target.recorded is None:
        raise ValueError(session.about["missing"]["recording"])
    content = session.target.recorded.read_bytes()
    return content[: content.rfind(b"\n") + 1]


def transcript_table(session: TargetSession, kind: str) -> bytes:
    """The table of `cubestack decode` as "csv" or "parquet".

    Raises as ``recording`` does, and ValueError for another kind or without pyarrow.
    """
    make: Callable[..., bytes] | None = TABLES.get(kind)
    if make is None:
        raise ValueError(f"no table {kind!r}; known: {', '.join(TABLES)}")
    content = recording(session)
    with TemporaryDirectory(prefix="cubestack-") as folder:
        path = Path(folder) / "session.rec"
        path.write_bytes(content)
        return make(transcript(load_recording(path), session.target.interface))


def results_table(session: TargetSession, kind: str) -> bytes:
    """The log of results as "csv" or "parquet"; raises as ``transcript_table`` does."""
    if kind not in FORMS:
        raise ValueError(f"no table {kind!r}; known: {', '.join(FORMS)}")
    return FORMS[kind](session.log)

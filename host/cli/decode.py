"""List the messages of a recording of the node protocol.

Every request with its answer, on the serial line and on I2C: when, its name, and its
fields by the device's table. A file has a row for each field.

examples:
  cubestack emulate {second} --record run.rec
  cubestack decode run.rec
  cubestack decode run.rec --out run.csv        or run.parquet (needs pyarrow)
  cubestack decode run.rec --json               one object per line
"""

import argparse
import json
from pathlib import Path

from cubestack.firmware_model.formats.recording import load_recording
from cubestack.firmware_model.formats.untrusted import shown
from cubestack.host.cli.arguments import add_flag, add_output, add_path
from cubestack.host.devices.registry import device
from cubestack.host.output import write_output
from cubestack.host.recording.transcript import TABLES, TranscriptEntry, transcript
from cubestack.host.terminal import say


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_path(parser, "recording", "see docs/how-to/recording.md")
    add_output(parser, "--out", "or FILE.parquet", "FILE.csv")
    add_flag(parser, "--json", "print one JSON object per message")


def run(args: argparse.Namespace) -> int:
    recording = load_recording(args.recording)
    messages = transcript(recording, device(recording.device).interface)
    if args.out is not None:
        _write(args.out, messages)
        say(f"wrote {len(messages)} messages to {args.out}")
    for one in messages if args.out is None else ():
        print(json.dumps(_object(one)) if args.json else shown(_line(one)))
    return 0


def _write(path: Path, messages: list[TranscriptEntry]) -> None:
    kind = path.suffix.removeprefix(".")
    if kind not in TABLES:
        raise ValueError(f"{path}: a table is .csv or .parquet, not {path.suffix}")
    write_output(path, TABLES[kind](messages))


def _object(one: TranscriptEntry) -> dict[str, object]:
    values = {k: v.hex() if isinstance(v, bytes) else v for k, v in one.values.items()}
    about = {"time_s": one.time_s, "port": one.port, "kind": one.kind, "message": one.name}
    return about | {"error": one.error, "values": values}


def _line(one: TranscriptEntry) -> str:
    fields = () if one.message is None else one.message.fields
    told = [f"{f.name} {f.label(one.values[f.name])}" for f in fields]
    error = [f"({one.error})"] if one.error else []
    words = " ".join([one.kind, one.name, *error])
    return f"{one.time_s:14.6f} s  {one.port}  {words}" + (f": {', '.join(told)}" if told else "")

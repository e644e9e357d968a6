"""A recording's messages as a table: a row per field of each message."""

import csv
from collections.abc import Iterable
from io import StringIO

from cubestack.host.export.parquet import parquet_file
from cubestack.host.recording.transcript import COLUMNS, TranscriptEntry

NUMBERS = ("time_s", "value")
"""Numeric columns."""


def csv_table(messages: Iterable[TranscriptEntry]) -> bytes:
    """The table as a CSV file."""
    text = StringIO(newline="")
    writer = csv.DictWriter(text, COLUMNS)
    writer.writeheader()
    writer.writerows(row for one in messages for row in one.rows())
    return text.getvalue().encode()


def parquet_table(messages: Iterable[TranscriptEntry]) -> bytes:
    """The table as a Parquet file; raises ValueError without pyarrow."""
    rows = [row for one in messages for row in one.rows()]
    return parquet_file({name: [row[name] for row in rows] for name in COLUMNS}, NUMBERS)


TABLES = {"csv": csv_table, "parquet": parquet_table}
"""By the file's suffix."""

"""Tables as Parquet files, for pandas, polars, DuckDB and their like; they need pyarrow."""

from collections.abc import Collection, Mapping, Sequence
from importlib import import_module
from importlib.util import find_spec
from io import BytesIO
from typing import Any

from cubestack.host.errors import install_command

Cell = bool | int | float | str | None


def missing() -> str:
    """Why no Parquet file can be written; empty if it can."""
    return "" if find_spec("pyarrow") else _missing()


def _missing() -> str:
    return f"Parquet needs pyarrow: {install_command('parquet')}"


def arrow() -> Any:
    """pyarrow, with its ``parquet``; ValueError without it."""
    try:
        import_module("pyarrow.parquet")
        return import_module("pyarrow")
    except ModuleNotFoundError:
        raise ValueError(_missing()) from None


def parquet_file(
    columns: Mapping[str, Sequence[Cell]], numbers: Collection[str] | None = None
) -> bytes:
    """Write a file with these columns, all of one length.

    Columns in ``numbers`` are float64, the others text. Without it, the type follows from the
    values: float64, bool or text. None is null.

    Raises ValueError for columns of several lengths, and without pyarrow.
    """
    made = arrow()
    if len({len(column) for column in columns.values()}) > 1:
        raise ValueError("the columns of a table are of one length")
    arrays = {}
    for name, column in columns.items():
        kind = _kind(column) if numbers is None else float if name in numbers else str
        types = {float: made.float64(), bool: made.bool_(), str: made.string()}
        cells = [None if cell is None else kind(cell) for cell in column]
        arrays[name] = made.array(cells, types[kind])
    sink = BytesIO()
    made.parquet.write_table(made.table(arrays), sink)
    return sink.getvalue()


def _kind(column: Sequence[Cell]) -> type[float] | type[bool] | type[str]:
    kinds = {type(cell) for cell in column if cell is not None}
    if kinds == {bool}:
        return bool
    return float if kinds and kinds <= {int, float} else str

"""A campaign's rows as one Parquet file, for pandas, polars, DuckDB and their like."""

from pathlib import Path

from cubestack.host.export.parquet import arrow as pyarrow
from cubestack.host.studies.campaign.folder import Folder

FILE = "rows.parquet"


def write(folder: Folder) -> Path:
    """Write the rows so far, a column per value; returns the file.

    Columns are the attributes of ``Row``; a swept option is ``swept.NAME``, a value of the result
    ``result.NAME``.

    Raises ValueError without rows, and without pyarrow.
    """
    arrow = pyarrow()
    table = arrow.Table.from_pylist([vars(row) for row in folder.rows()])
    if not table.num_rows:
        raise ValueError(f"{folder.path} has no rows yet")
    for nested in ("swept", "result"):
        at = table.schema.get_field_index(nested)
        fields = table.column(at).combine_chunks()
        table = table.remove_column(at)
        for name, column in zip((one.name for one in fields.type), fields.flatten(), strict=True):
            table = table.append_column(f"{nested}.{name}", column)
    new = folder.path / f"{FILE}.new"
    arrow.parquet.write_table(table, new)
    return new.replace(folder.path / FILE)

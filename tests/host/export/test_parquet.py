"""Oracle: pyarrow."""

import sys
from io import BytesIO

import pyarrow.parquet
import pytest

from cubestack.host.export.parquet import missing, parquet_file


def test_each_column_has_one_type() -> None:
    columns = {
        "number": [1, None, 2.5],
        "truth": [True, False, None],
        "word": ["a", None, "b\n\N{GREEK SMALL LETTER MU}"],
        "mixed": [1, "x", True],
        "nothing": [None, None, None],
    }
    table = pyarrow.parquet.read_table(BytesIO(parquet_file(columns)))
    assert table.to_pydict() == columns | {"mixed": ["1", "x", "True"]}
    assert [str(one.type) for one in table.schema] == ["double", "bool", *["string"] * 3]


def test_number_columns_may_be_empty() -> None:
    made = parquet_file({"value": [None], "text": [None]}, numbers=("value",))
    schema = pyarrow.parquet.read_schema(BytesIO(made))
    assert [str(one.type) for one in schema] == ["double", "string"]


def test_rejects_columns_of_different_lengths() -> None:
    with pytest.raises(ValueError, match="of one length"):
        parquet_file({"a": [1], "b": []})


def test_missing_pyarrow_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    assert missing() == ""
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert missing() == "Parquet needs pyarrow: pip install pyarrow"
    with pytest.raises(ValueError, match="Parquet needs pyarrow: pip install pyarrow"):
        parquet_file({"a": [1]})

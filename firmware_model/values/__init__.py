"""Declared values: name, type, unit, limits, default, choices and meaning, in one form everywhere.

Message fields, keys of scene files, hazards, faults, options and settings are declared with it.
Checks, error texts, help, forms and documents derive from the declaration.
"""

from cubestack.firmware_model.values.declaration import (
    FLAG,
    NUMBER,
    REQUIRED,
    TABLE,
    TEXT,
    WHOLE,
    Declaration,
    ListDeclaration,
    ValueKind,
    choice,
    declare,
    flag,
    many,
    moment,
    number,
    plain,
    positive,
    text,
    vector,
    whole,
)
from cubestack.firmware_model.values.declared import DeclaredValues
from cubestack.firmware_model.values.tables import (
    Keys,
    KindsDeclaration,
    TableDeclaration,
    described,
    named,
    read_table,
    table,
    with_defaults,
)

__all__ = [
    "FLAG",
    "NUMBER",
    "REQUIRED",
    "TABLE",
    "TEXT",
    "WHOLE",
    "Declaration",
    "DeclaredValues",
    "Keys",
    "KindsDeclaration",
    "ListDeclaration",
    "TableDeclaration",
    "ValueKind",
    "choice",
    "declare",
    "described",
    "flag",
    "many",
    "moment",
    "named",
    "number",
    "plain",
    "positive",
    "read_table",
    "table",
    "text",
    "vector",
    "whole",
    "with_defaults",
]

"""The fields of a kind of file, table by table, as a page in Markdown, from the classes that check it.

What a table is stands in its class's docstring, what a field is in the remark behind it (fields.py).
"""

from __future__ import annotations

import inspect
import json
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel

from multiphi_exudyn.study.scene.toml_file import kind_of, tables_in

__all__ = ["file_reference"]

LIMITS = {"minimum": ">=", "exclusiveMinimum": ">", "maximum": "<=", "exclusiveMaximum": "<"}
MANY = 5  # kinds of values from which a field is said to take any
WORDS = {"number": "number", "integer": "whole number", "string": "text", "boolean": "true or false", "null": "none"}


def file_reference(whole: type[BaseModel], title: str) -> str:
    """The page: one section for each table that the file may hold, in the order in which they are first met."""
    return "\n".join([f"# {title}", "", *(_section(path, table) for path, table in _tables(whole))])


def _tables(whole: type[BaseModel]) -> Iterator[tuple[str, type[BaseModel]]]:
    """Every class of table, with the place where it is first met."""
    waiting, met = [("", whole)], {whole}
    while waiting:
        path, table = waiting.pop(0)
        yield path, table
        for name, field in table.model_fields.items():
            for inside in tables_in(field.annotation):
                if inside not in met:
                    met.add(inside)
                    waiting.append((f"{path}.{name}".lstrip("."), inside))


def _section(path: str, table: type[BaseModel]) -> str:
    """Heading, what the table is, and its fields."""
    kind = f", kind = {json.dumps(kind_of(table))}" if kind_of(table) else ""
    heading = f"## `{path}`{kind}" if path else "## The file"
    fields = table.model_json_schema()["properties"]
    rows = [
        f"| `{name}` | {_type(field)} | {_default(table, name)} | {field.get('description', '')} |"
        for name, field in fields.items()
        if name != "kind"
    ]
    text = inspect.getdoc(table) or ""
    return "\n".join([heading, "", text, "", "| field | value | default | |", "|---|---|---|---|", *rows, ""])


def _default(table: type[BaseModel], name: str) -> str:
    field = table.model_fields[name]
    if field.is_required():
        return "needed"
    value = field.get_default(call_default_factory=True)
    if value is None or isinstance(value, BaseModel) or value in ((), {}):
        return "none" if not isinstance(value, BaseModel) else "as below"
    return f"`{'rigid' if value == float('inf') else json.dumps(value)}`"


def _type(field: Mapping[str, Any]) -> str:
    """What a field takes, in words."""
    if "$ref" in field:
        return "table"
    options = field.get("anyOf") or field.get("oneOf")
    if options:
        words = dict.fromkeys(text for option in options if (text := _type(option)) != "none")
        return " or ".join(words) if len(words) < MANY else "value"
    if "enum" in field or "const" in field:
        return " or ".join(f"`{value}`" for value in field.get("enum", [field.get("const")]))
    kind = field.get("type")
    if kind == "array":
        inside = field.get("items") or {"anyOf": field.get("prefixItems", [{}])}
        return f"list of: {_type(inside)}"
    if kind == "object":
        values = field.get("additionalProperties")
        return f"{{name: {_type(values)}}}" if isinstance(values, dict) else "table"
    limits = " and".join(f" {sign} {field[limit]:g}" for limit, sign in LIMITS.items() if limit in field)
    return f"{WORDS.get(str(kind), 'value')}{limits}"

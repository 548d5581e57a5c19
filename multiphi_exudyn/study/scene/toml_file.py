"""Read TOML files and validate them; every error is one line with file and fields."""

from __future__ import annotations

import inspect
import json
import sys
import typing
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import did_you_mean

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["kind_of", "read_toml", "tables_in", "validated"]

Form = TypeVar("Form", bound=BaseModel)

MOST = 12  # faults listed in one error


def read_toml(path: Path) -> dict[str, Any]:
    """Read the raw content of a file."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise MultiPhiValueError(f"{path}: got {_one_line(error)}, need a readable TOML file") from error


def validated(form: type[Form], path: Path, data: Mapping[str, Any]) -> Form:
    """Validate ``data`` as a ``form``; the error names ``path`` and every wrong field, unknown ones first."""
    try:
        return form.model_validate_json(json.dumps(data, default=str))
    except ValidationError as error:
        raise MultiPhiValueError(f"{path}: {_fault_text(form, error, data)}") from error


def _fault_text(form: type[BaseModel], error: ValidationError, data: Mapping[str, Any]) -> str:
    """One line with every wrong field, its value and what is needed."""
    faults_by_field: dict[str, tuple[bool, str, list[str]]] = {}
    for item in error.errors(include_url=False):
        missing, unknown = item["type"] == "missing", item["type"] == "extra_forbidden"
        field = _field(item["loc"], data, missing)
        given = "nothing" if missing else _one_line(repr(item["input"]))
        needed = _needed(item) + (
            did_you_mean(item["loc"][-1], _allowed_fields(form, data, item["loc"])) if unknown else ""
        )
        faults_by_field.setdefault(field, (unknown, given, []))[2].append(needed)
    faults = [
        f"{field}: got {given}, need {' or '.join(dict.fromkeys(needs))}"
        for field, (_, given, needs) in sorted(faults_by_field.items(), key=lambda each: not each[1][0])
    ]
    more = f" (and {len(faults) - MOST} more)" if len(faults) > MOST else ""
    return "; ".join(faults[:MOST]) + more


def _allowed_fields(form: type[BaseModel], data: Any, location: Sequence[int | str]) -> set[str]:
    """Names of the fields allowed in the table that contains a location."""
    tables = [form]
    for part in location[:-1]:
        fields = [table.model_fields[str(part)] for table in tables if part in table.model_fields]
        tables = [inner for field in fields for inner in tables_in(field.annotation)] or tables
        if part in data if isinstance(data, Mapping) else isinstance(part, int):
            data = data[part]  # else a label of the validator for the branch of a union
    return {
        name for table in tables if data.get("kind", kind_of(table)) == kind_of(table) for name in table.model_fields
    }


def tables_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """Classes of tables in the annotation of a field."""
    if inspect.isclass(annotation) and issubclass(annotation, BaseModel):
        yield annotation
    for inside in typing.get_args(annotation):
        yield from tables_in(inside)


def kind_of(table: type[BaseModel]) -> str | None:
    """Value of the field ``kind`` of a table class; None without such a field."""
    field = table.model_fields.get("kind")
    return typing.get_args(field.annotation)[0] if field else None


def _needed(item: Mapping[str, Any]) -> str:
    kinds = {
        "missing": "a value",
        "dict_type": "a table",
        "model_type": "a table",
        "extra_forbidden": "a known field",
        "union_tag_invalid": f"one of the kinds {item.get('ctx', {}).get('expected_tags')}",
        "union_tag_not_found": "a table with the field kind",
    }
    return kinds.get(item["type"], _one_line(item["msg"]).removeprefix("Input should be "))


def _field(location: Sequence[int | str], data: Any, missing: bool) -> str:
    """Dotted path in the file, without the validator's labels of the branches of a union."""
    text = ""
    for i, part in enumerate(location):
        if isinstance(part, int) and isinstance(data, list):
            text += f"[{part}]"
            data = data[part]
        elif isinstance(data, Mapping) and (part in data or (missing and i == len(location) - 1)):
            text += f".{part}" if text else str(part)
            data = data.get(part)
    return text or "scene"


def _one_line(text: object) -> str:
    """The text on one line of at most 120 characters."""
    line = " ".join(str(text).split())
    return line if len(line) <= 120 else line[:117] + "..."

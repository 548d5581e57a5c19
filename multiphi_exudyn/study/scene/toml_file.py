"""Files in TOML: read, and validated against a form; every error is one line naming file and field."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from multiphi_exudyn.errors import MultiPhiValueError

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

__all__ = ["read_toml", "validated"]

Form = TypeVar("Form", bound=BaseModel)


def read_toml(path: Path) -> dict[str, Any]:
    """Raw content of a file."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise MultiPhiValueError(f"{path}: got {_one_line(error)}, need a readable TOML file") from error


def validated(form: type[Form], path: Path, data: Mapping[str, Any]) -> Form:
    """``data`` in its form; the error names ``path``, the first wrong field, and how many more there are."""
    try:
        return form.model_validate_json(json.dumps(data, default=str))
    except ValidationError as error:
        raise MultiPhiValueError(f"{path}: {_complaint(error, data)}") from error


def _complaint(error: ValidationError, data: Mapping[str, Any]) -> str:
    """The first wrong field: what was given, what is needed, and how many more there are."""
    found: dict[str, tuple[str, list[str]]] = {}
    for item in error.errors(include_url=False):
        missing = item["type"] == "missing"
        field = _field(item["loc"], data, missing)
        given = "nothing" if missing else _one_line(repr(item["input"]))
        found.setdefault(field, (given, []))[1].append(_needed(item))
    field, (given, needs) = next(iter(found.items()))
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    return f"{field}: got {given}, need {' or '.join(dict.fromkeys(needs))}{more}"


def _needed(item: Mapping[str, Any]) -> str:
    kinds = {
        "missing": "a value",
        "extra_forbidden": "no field of this name",
        "union_tag_invalid": f"a kind among {item.get('ctx', {}).get('expected_tags')}",
        "union_tag_not_found": "a table with the field kind",
    }
    return kinds.get(item["type"], _one_line(item["msg"]).removeprefix("Input should be "))


def _field(location: Sequence[int | str], data: Any, missing: bool) -> str:
    """Dotted place in the file, without the labels the validator gives to the branches of a union."""
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
    """At most 120 characters on one line."""
    line = " ".join(str(text).split())
    return line if len(line) <= 120 else line[:117] + "..."

"""What the tables of a scene file are made of: numbers with bounds, names, places, and the table itself."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Mapping
from typing import Annotated, Any, Literal, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    GetJsonSchemaHandler,
    WithJsonSchema,
)
from pydantic_core import PydanticCustomError

from multiphi_exudyn.errors import MultiPhiError, MultiPhiValueError

__all__ = [
    "Finite",
    "Modes",
    "Name",
    "NotNegative",
    "NotZero",
    "Place",
    "Positive",
    "RelativeTolerance",
    "Stiffness",
    "Table",
    "by_key",
    "inside",
    "numbered",
    "place_phrase",
]

REMARK = re.compile(r"^    (\w+): .*?  # (.*)$", re.MULTILINE)

T = TypeVar("T")


def _not_zero(value: float) -> float:
    if value == 0:
        raise PydanticCustomError("zero", "a value that is not zero")
    return value


def _rigid_is_infinite(value: Any) -> Any:
    if isinstance(value, str) and value != "rigid":
        raise PydanticCustomError("stiffness", "a number or 'rigid'")
    return math.inf if value == "rigid" else value


Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Stiffness = Annotated[  # N/m or N m; inf or "rigid"
    float,
    BeforeValidator(_rigid_is_infinite),
    Field(gt=0),
    WithJsonSchema({"anyOf": [{"type": "number", "exclusiveMinimum": 0}, {"const": "rigid"}]}),
]
NotZero = Annotated[float, Field(allow_inf_nan=False), AfterValidator(_not_zero)]
Name = Annotated[str, Field(min_length=1, pattern=r"^[\w.{}-]+$")]
Place = Name | Annotated[dict[Name, Finite], Field(min_length=1)]  # of a load: a point, or coefficients of points
Modes = Annotated[int, Field(ge=1)] | Literal["all"]
RelativeTolerance = Annotated[float, Field(ge=1e-13, lt=1)]  # below it lies round-off


def by_key(*keys: str) -> Discriminator:
    """Choose a table's form by the key that only this form has."""

    def choose(given: Any) -> str | None:
        return next((f"<{key}>" for key in keys if isinstance(given, Mapping) and key in given), None)

    needed = "a table with the field " + " or ".join(keys)
    return Discriminator(choose, custom_error_type="form", custom_error_message=needed)


def numbered(name: str, i: int) -> str:
    """The name of the i-th of a row."""
    return name.replace("{i}", str(i))


def place_phrase(at: str | Mapping[str, float]) -> str:
    """A place as part of a sentence."""
    return at if isinstance(at, str) else " and ".join(f"{factor:+g} {name}" for name, factor in at.items())


def inside(place: str, build: Callable[[], T]) -> T:
    """What ``build`` gives; its error names the place, and the field inside it where it begins with a dot."""
    try:
        return build()
    except MultiPhiError as error:
        text = " ".join(str(error).split())
        raise MultiPhiValueError(f"{place}{'' if text.startswith('.') else ': '}{text}") from error


class Table(BaseModel):
    """A table of a scene file: every field typed, none unknown; the remark behind a field describes it."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    @classmethod
    def __get_pydantic_json_schema__(cls, core: Any, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        schema = handler.resolve_ref_schema(handler(core))
        owners = [owner for owner in reversed(cls.__mro__) if issubclass(owner, Table)]
        remarks = dict(remark for owner in owners for remark in REMARK.findall(inspect.getsource(owner)))
        for name, field in schema["properties"].items():
            field |= {"description": remarks[name]} if name in remarks else {}
        return schema

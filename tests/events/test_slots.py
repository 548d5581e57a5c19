"""No two names stand for one slot of a record in the arrays of the loop."""

import ast
import collections
from pathlib import Path

import pytest

from multiphi_exudyn.events import arrays


def names_between(first, last):
    """Names that arrays.py gives from the statement that names one on, until the one that names another."""
    found, inside = [], False
    for statement in ast.parse(Path(arrays.__file__).read_text()).body:
        if isinstance(statement, ast.Assign):
            target = statement.targets[0]
            given = [part.id for part in (target.elts if isinstance(target, ast.Tuple) else [target])]
            if last in given:
                return found
            inside = inside or first in given
            found += given if inside else []
    raise AssertionError(f"no {first} before {last}")


@pytest.mark.parametrize(
    ("first", "size"),
    [("ELEMENTS", "RUN_INTS"), ("TIME", "RUN_NUMBERS"), ("NUMBER", "LEVEL_INTS"), ("ELEMENT", "EXIT_INTS")],
)
def test_every_slot_has_one_name(first, size):
    places = collections.Counter(getattr(arrays, name) for name in names_between(first, size))
    assert [place for place, count in places.items() if count > 1] == []
    assert max(places) < getattr(arrays, size)

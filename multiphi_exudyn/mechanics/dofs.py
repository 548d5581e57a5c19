"""Degrees of freedom by node and component, such as (5, "uz"), and the rows of the matrices they have.

Components are ux, uy, uz [m] and rx, ry, rz [rad], or their numbers 1 to 6 as in finite element programs. Nodes have
their numbers of the program.
"""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import is_real, one_of

__all__ = ["COMPONENTS", "DofTable", "Place", "dof_table", "fixed_dofs", "node_component", "required_table"]

Place: TypeAlias = "int | tuple[int, int | str]"  # a DoF index, or (node, component)

COMPONENTS = ("ux", "uy", "uz", "rx", "ry", "rz")
EVERY = "all"  # components of a node
NEEDED = "need (node number, component) for every row of the matrices"


@dataclass(frozen=True)
class DofTable:
    """Table of the rows of matrices: (node, name of the component) of every row, each once."""

    rows: tuple[tuple[int, str], ...]

    @classmethod
    def of(cls, rows: Iterable[tuple[int, str]]) -> DofTable:
        """A table of these rows, sorted by node and component."""
        return cls(tuple(sorted(rows, key=lambda row: (row[0], COMPONENTS.index(row[1])))))

    @functools.cached_property
    def _rows_by_node(self) -> dict[int, dict[str, int]]:
        rows: dict[int, dict[str, int]] = {}
        for row, (node, component) in enumerate(self.rows):
            rows.setdefault(node, {})[component] = row
        return rows

    def place(self, name: str, node: Any, component: Any) -> int:
        """Row of a node's component; name: of the argument, for errors."""
        components = self._node(name, node)
        component_name = _component(name, component)
        if component_name not in components:
            raise MultiPhiValueError(
                f"{name}: got {component_name!r} of node {node}, need {one_of(component_name, components)}"
            )
        return components[component_name]

    def places(self, name: str, node: Any, component: Any) -> list[int]:
        """Rows of a node's component, or of all its components for "all"."""
        if isinstance(component, str) and component == EVERY:
            return list(self._node(name, node).values())
        return [self.place(name, node, component)]

    def restricted_to(self, places: np.ndarray) -> DofTable:
        """Table with these rows alone."""
        return DofTable(tuple(self.rows[place] for place in places.tolist()))

    def _node(self, name: str, node: Any) -> dict[str, int]:
        number = _node_number(name, node)
        if number not in self._rows_by_node:
            nodes = self._rows_by_node
            nearest = min(nodes, key=lambda other: abs(other - number))
            needed = f"one of {len(nodes)} nodes from {min(nodes)} to {max(nodes)}; did you mean {nearest}?"
            raise MultiPhiValueError(f"{name}: got node {node}, need {needed}")
        return self._rows_by_node[number]


def dof_table(given: Any, n: int) -> DofTable:
    """Table of n rows from (node, component) of each."""
    if isinstance(given, (str, Mapping)) or not isinstance(given, (Iterable, DofTable)):
        raise MultiPhiTypeError(f"dofs: got {type(given).__name__}, {NEEDED}")
    pairs = given.rows if isinstance(given, DofTable) else tuple(given)
    if len(pairs) != n:
        raise MultiPhiValueError(f"dofs: got {len(pairs)} rows, need {n} as the mass has")
    if isinstance(given, DofTable):
        return given
    rows = tuple(node_component(f"dofs[{i}]", pair) for i, pair in enumerate(pairs))
    if len(set(rows)) < n:
        twice = Counter(rows).most_common(1)[0][0]
        raise MultiPhiValueError(f"dofs: got {twice} twice, need each node's component once")
    return DofTable(rows)


def fixed_dofs(given: Any, n: int, dofs: DofTable | None) -> np.ndarray:
    """Fixed ones (k,) of n degrees of freedom, ascending, from DoF indices, or (node, component) of a table."""
    needed = 'need a list of DoF indices, (node, component) or (node, "all")'
    if isinstance(given, (str, bytes, Mapping)) or not isinstance(given, Iterable):
        raise MultiPhiTypeError(f"fixed: got {given!r}, {needed}")
    fixed: set[int] = set()
    for item in given:
        if isinstance(item, tuple) and len(item) == 2:
            fixed.update(required_table(f"fixed {item!r}", dofs).places("fixed", *item))
        elif isinstance(item, (int, np.integer)) and not isinstance(item, bool):
            if dofs is not None:
                needed_form = f'(node, component) or (node, "all"), as ({item}, "all"): the rows have nodes'
                raise MultiPhiValueError(f"fixed: got {item}, need {needed_form}")
            if not 0 <= item < n:
                raise MultiPhiValueError(f"fixed: got DoF {item}, need 0 <= DoF < {n}")
            fixed.add(int(item))
        else:
            raise MultiPhiTypeError(f"fixed: got {item!r}, {needed}")
    if len(fixed) == n:
        raise MultiPhiValueError(f"fixed: got all {n} degrees of freedom, need some that can move")
    return np.array(sorted(fixed), int)


def required_table(name: str, dofs: DofTable | None) -> DofTable:
    """The table of degrees of freedom; raise without one."""
    if dofs is None:
        raise MultiPhiValueError(
            f"{name}: got a node, but nothing says which node each row belongs to; need a row, from 0, or dofs="
        )
    return dofs


def _component(name: str, given: Any) -> str:
    """Name of a component from its name or its number, 1 to 6."""
    if isinstance(given, str):
        if given.lower() in COMPONENTS:
            return given.lower()
        raise MultiPhiValueError(f"{name}: got component {given!r}, need 1 to 6 or {one_of(given, COMPONENTS)}")
    if is_real(given) and given in range(1, len(COMPONENTS) + 1):
        return COMPONENTS[int(given) - 1]
    raise MultiPhiValueError(f"{name}: got component {given!r}, need 1 to 6 or one of: {', '.join(COMPONENTS)}")


def node_component(name: str, given: Any) -> tuple[int, str]:
    """Number of a node and name of its component; name: of the argument, for errors."""
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise MultiPhiTypeError(f"{name}: got {given!r}, need (node number, component)")
    pair = tuple(given)
    if len(pair) != 2:
        raise MultiPhiValueError(f"{name}: got {given!r}, need (node number, component)")
    return _node_number(name, pair[0]), _component(name, pair[1])


def _node_number(name: str, given: Any) -> int:
    if not is_real(given) or given != int(given):
        raise MultiPhiTypeError(f"{name}: got node {given!r}, need a node number")
    return int(given)

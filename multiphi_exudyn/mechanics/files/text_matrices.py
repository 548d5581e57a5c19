"""Text matrices of finite element programs: triplets of Abaqus and CalculiX, and Harwell-Boeing.

    row column value                           Abaqus *MATRIX OUTPUT, FORMAT=COORDINATE; CalculiX .sti and .mas; Matrix
                                               Market without its banner, after a line of rows, columns and entries
    node, component, node, component, value    Abaqus *MATRIX OUTPUT, FORMAT=MATRIX INPUT or LABELS
    rows of one triangle, after a keyword      Abaqus *SUBSTRUCTURE MATRIX OUTPUT
    four lines of header, then columns         Harwell-Boeing and Rutherford-Boeing, assembled, real or integer: Ansys
                                               HBMAT, LS-DYNA, the SuiteSparse collection

Rows and columns count from 1. One triangle of a symmetric matrix is enough. scipy.io.hb_read does not read symmetric
matrices, as those of structures are.

Sources: Abaqus Analysis User's Guide, 10.3.1; I. S. Duff, R. G. Grimes, J. G. Lewis, Users' guide for the
Harwell-Boeing sparse matrix collection, RAL-92-086, 1992.
"""

from __future__ import annotations

import gzip
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse

from multiphi_exudyn.mechanics.structures.arguments import Matrix
from multiphi_exudyn.mechanics.structures.dofs import DofTable, node_component

__all__ = ["NodalMatrix", "complete", "harwell_boeing", "lines_of", "same_rows", "substructure_matrices", "triplets"]

HEADER = 4  # lines
CARD = 14  # characters of a number in the header
FORMAT = re.compile(r"\((?:(\d+)P,?)?(\d*)([IEDFG])(\d+)", re.IGNORECASE)
TYPES = "RI", "SU", "A"  # real or integer; symmetric or unsymmetric; assembled
SUBSTRUCTURE = re.compile(r"\*MATRIX,TYPE=(\w+)", re.IGNORECASE)
FORTRAN = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d)")  # of exponents in double precision
EMPTY_ROWS = 100  # rows for every entry: with more rows an index is wrong, and the matrix would take much memory


@dataclass(frozen=True)
class NodalMatrix:
    """A matrix (n, n) with the node and component of every row."""

    matrix: Matrix
    dofs: DofTable

    def in_rows(self, dofs: DofTable) -> Matrix:
        """The matrix in the rows of another table, which contains all its rows."""
        indices = {row: index for index, row in enumerate(dofs.rows)}
        own_rows = np.array([indices[row] for row in self.dofs.rows])
        entries = scipy.sparse.coo_array(self.matrix)
        size = (len(dofs.rows),) * 2
        return scipy.sparse.csr_array((entries.data, (own_rows[entries.row], own_rows[entries.col])), shape=size)


def same_rows(matrices: Iterable[NodalMatrix]) -> DofTable:
    """Table of all rows of these matrices, by node and component."""
    return DofTable.of({row for matrix in matrices for row in matrix.dofs.rows})


def triplets(path: Path) -> Matrix | NodalMatrix:
    """A matrix of (row, column, value) or (node, component, node, component, value), one entry a line."""
    lines = [line.replace(",", " ") for line in lines_of(path) if line[0] not in "*%"]
    columns = len(lines[0].split()) if lines else 0
    if columns not in (3, 5):
        raise ValueError(
            f"a line has {columns} columns, and not 3 (row, column, value) or 5 (twice node and component, value)"
        )
    table = np.loadtxt([FORTRAN.sub("e", line) for line in lines], ndmin=2, dtype=float)
    labels = table[:, :-1].astype(np.int64)
    if not np.array_equal(labels, table[:, :-1]):
        raise ValueError("a row or column is no whole number")
    if columns == 3:
        first = 1 if _begins_with_size(lines[0], table) else 0
        rows, values = labels[first:], table[first:, 2]
        n = int(np.max(labels))
        if np.min(labels) < 1 or n > EMPTY_ROWS * len(lines):
            raise ValueError(f"its {len(lines)} entries are in rows and columns from {np.min(labels)} to {n}")
        return complete(scipy.sparse.csr_array((values, (rows[:, 0] - 1, rows[:, 1] - 1)), shape=(n, n)))
    own_rows, indices = np.unique(labels.reshape(-1, 2), axis=0, return_inverse=True)
    dofs = DofTable(tuple(node_component("a line", pair) for pair in own_rows.tolist()))
    i, j = indices.reshape(-1, 2).T
    return NodalMatrix(complete(scipy.sparse.csr_array((table[:, 4], (i, j)), shape=(len(own_rows),) * 2)), dofs)


def _begins_with_size(line: str, table: np.ndarray) -> bool:
    """Whether the first line of (row, column, value) is "rows columns entries", as its own numbers and the others say.

    table: (k, 3) of all lines. Raises ValueError for a first line that is neither a size nor an entry.
    """
    if not re.fullmatch(r"\s*(\d+)\s+\1\s+\d+(\.0*)?\s*", line) or len(table) < 2:
        return False
    n, _, entries = table[0]
    others = table[1:]
    is_entry = not np.any(np.all(others[:, :2] == n, axis=1))
    is_size = n == np.max(others[:, :2]) and entries == len(others)
    if not (is_entry or is_size):
        raise ValueError(
            f"its first line reads {line.strip()!r}, which is no size, as {len(others)} entries follow, in rows and "
            f"columns up to {np.max(others[:, :2]):g}, and no entry, as this one follows again"
        )
    if is_entry and is_size and "." in line:
        raise ValueError(
            f"its first line reads {line.strip()!r}, which may be a size or an entry; write a size in whole numbers, "
            "or that entry in another line"
        )
    return is_size


def substructure_matrices(path: Path) -> dict[str, np.ndarray]:
    """The matrices of an Abaqus substructure by type, "stiffness", "mass", ...; empty for another file."""
    triangles: dict[str, list[str]] = {}
    kind = None
    for line in lines_of(path):
        if line[0] == "*":
            found = SUBSTRUCTURE.match(line.replace(" ", ""))
            kind = found[1].lower() if found else None
        elif kind is not None:
            triangles.setdefault(kind, []).extend(number for number in line.replace(",", " ").split())
    return {kind: _from_triangle(kind, np.array(numbers, float)) for kind, numbers in triangles.items()}


def _from_triangle(kind: str, values: np.ndarray) -> np.ndarray:
    """A symmetric matrix from the rows of its lower triangle, one after the other."""
    n = math.isqrt(2 * len(values))
    if n * (n + 1) // 2 != len(values):
        raise ValueError(f"its {kind} matrix has {len(values)} numbers, which are no triangle")
    matrix = np.zeros((n, n))
    matrix[np.tril_indices(n)] = values
    return matrix + np.tril(matrix, -1).T


def harwell_boeing(path: Path) -> Matrix:
    """A matrix in the Harwell-Boeing or Rutherford-Boeing format."""
    with path.open(encoding="latin-1") as file:
        lines = file.read().splitlines()
    if len(lines) < HEADER:
        raise ValueError("it ends inside its header")
    kind = lines[2][:3].upper()
    if len(kind) < 3 or any(letter not in known for letter, known in zip(kind, TYPES, strict=True)):
        raise ValueError(f"its matrix is of the type {kind!r}; read are assembled real ones, RSA and RUA")
    cards, (rows, columns, entries) = _numbers(lines[1], 4), _numbers(lines[2], 3)
    if rows != columns:
        raise ValueError(f"its matrix has {rows} rows and {columns} columns")
    first = HEADER + (cards[3] > 0)  # a line on right-hand sides, which are left out
    arrays = []
    layouts = lines[3][:16], lines[3][16:32], lines[3][32:52]
    for layout, length, count in zip(layouts, cards[:3], (columns + 1, entries, entries), strict=True):
        arrays.append(_fields(lines[first : first + length], layout, count))
        first += length
    pointers, indices = (array.astype(np.int64) - 1 for array in arrays[:2])
    matrix = scipy.sparse.csc_array((arrays[2], indices, pointers), shape=(rows, columns))
    matrix.check_format(full_check=True)  # indices outside of the shape are read as addresses
    return complete(scipy.sparse.csr_array(matrix)) if kind[1] == "S" else matrix


def lines_of(path: Path) -> list[str]:
    """Lines of a text file, compressed or not, without empty lines and blanks at both ends."""
    with gzip.open(path, "rt", encoding="latin-1") if path.suffix == ".gz" else path.open(encoding="latin-1") as file:
        return [line.strip() for line in file if line.strip()]


def _numbers(line: str, count: int) -> list[int]:
    """Numbers of a line of the header, after its first field; zero if missing."""
    return [int(line[CARD * k : CARD * (k + 1)].strip() or 0) for k in range(1, count + 1)]


def _fields(lines: list[str], layout: str, count: int) -> np.ndarray:
    """Numbers (count,), separated by blanks or of fixed width without blanks."""
    form = FORMAT.search(layout.replace(" ", ""))
    if form is None or (form[1] and form[3].upper() == "F"):
        raise ValueError(f"its numbers have the format {layout.strip()!r}")
    fields = " ".join(lines).split()
    if len(fields) != count:
        width, each = int(form[4]), int(form[2] or 1)
        text = "".join(line[: width * each].ljust(width * each) for line in lines)
        if len(text) < width * count:
            raise ValueError(f"it has fewer than the {count} numbers that its header says")
        fields = [text[width * k : width * (k + 1)] for k in range(count)]
    return np.char.replace(np.char.upper(np.array(fields, dtype=str)), "D", "E").astype(float)


def complete(matrix: Matrix) -> Matrix:
    """A matrix (n, n), with both triangles if only one is given."""
    triangle = scipy.sparse.csr_array(matrix - scipy.sparse.diags_array(matrix.diagonal()))
    triangle.eliminate_zeros()
    if triangle.nnz and not (abs(triangle) * abs(triangle).T).nnz:
        return scipy.sparse.csr_array(matrix + triangle.T)
    return matrix

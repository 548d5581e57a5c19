"""Mechanical objects from the tables of a scene file: beams, sections, matrices, damping."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import scipy.sparse

from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.mechanics.beam import Beam, Clamp, PointMass
from multiphi_exudyn.mechanics.damping import ModalDamping, RayleighDamping
from multiphi_exudyn.mechanics.matrix_files import read_array, read_arrays, read_structure
from multiphi_exudyn.mechanics.section import Section
from multiphi_exudyn.mechanics.structure import LinearStructure
from multiphi_exudyn.study.scene.fields import numbered
from multiphi_exudyn.study.scene.scene_file import (
    DampingSpec,
    ModalDampingSpec,
)
from multiphi_exudyn.study.scene.structure_tables import (
    BeamSpec,
    MatrixFiles,
    MatrixStructure,
    PointRow,
    RectangleSection,
    SectionSpec,
)

__all__ = ["beam_of", "damping_of", "matrices_of"]


def beam_of(spec: BeamSpec) -> Beam:
    """A beam with its points, masses and clamp."""
    return Beam(
        [_section(section) for section in spec.sections],
        dict(_points(spec)),
        [PointMass(mass.at, mass.mass, mass.inertia) for mass in spec.masses],
        Clamp(spec.clamp.translation, spec.clamp.rotation),
    )


def _points(spec: BeamSpec) -> Iterator[tuple[str, float]]:
    for name, at in spec.points.items():
        if not isinstance(at, PointRow):
            yield name, at
        elif "{i}" not in name:
            raise MultiPhiValueError(f"points: got the name {name!r} for {at.count} points, need one with {{i}}")
        else:
            places = np.linspace(at.first, at.last, at.count).tolist()
            yield from ((numbered(name, i), x) for i, x in enumerate(places, start=1))


def _section(spec: SectionSpec) -> Section:
    if isinstance(spec, RectangleSection):
        return Section.rectangle(**spec.model_dump())
    return Section(**spec.model_dump())


def matrices_of(folder: Path, spec: MatrixStructure) -> LinearStructure:
    """A structure from files, whose names are relative to a folder."""
    files = spec.matrices
    if isinstance(files, MatrixFiles):
        rows = {name: _own_row(folder, name, at) if isinstance(at, str) else at for name, at in spec.points.items()}
        damping = None if files.damping is None else folder / files.damping
        return read_structure(folder / files.mass, folder / files.stiffness, damping, rows)
    arrays = read_arrays("matrices", folder / files)
    return LinearStructure(
        _array(arrays, "mass"),
        _array(arrays, "stiffness"),
        arrays.get("damping"),
        {name: _array(arrays, at) if isinstance(at, str) else at for name, at in spec.points.items()},
    )


def _own_row(folder: Path, name: str, path: str) -> np.ndarray:
    row = read_array(f"points[{name!r}]", folder / path)
    return np.squeeze(row.toarray() if scipy.sparse.issparse(row) else row)


def _array(arrays: Mapping[str, np.ndarray], name: str) -> np.ndarray:
    if name not in arrays:
        raise MultiPhiValueError(f"matrices: got the arrays {', '.join(arrays) or 'none'}, need {name!r}")
    return arrays[name]


def damping_of(spec: DampingSpec) -> ModalDamping | RayleighDamping:
    """Damping by modal ratios, or of Rayleigh."""
    if isinstance(spec, ModalDampingSpec):
        return ModalDamping(spec.modal_ratios, spec.beyond)
    return RayleighDamping(spec.alpha, spec.beta)

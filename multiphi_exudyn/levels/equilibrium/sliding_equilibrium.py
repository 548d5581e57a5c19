"""Static response with friction: some of the active links slide.

Their friction is proportional to their normal force: lambda_o = lambda_o(load) + W lambda_o, W (o, o) the contact
forces of unit friction. Where a minor of I - W is not positive, contacts wedge and the equilibrium is not unique.
"""

from __future__ import annotations

import itertools

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.levels.base.modal_base import ModalBase

__all__ = ["static_response_with_friction"]

UNIQUE = 1e-11  # of a normal force: a smaller remainder beside friction is round-off of zero


def static_response_with_friction(
    base: ModalBase, index: list[int], gaps: np.ndarray, load: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return forces (l,) and y (m,) of the static response with these active links, with friction of sliding ones."""
    forces, configuration = _frictionless_response(base, index, gaps, load)
    sliders = [k for k in index if k in base.oblique]
    if not sliders:
        return forces, configuration
    added = base.pushes[:, sliders] - base.directions[:, sliders]
    friction_forces = np.array([_frictionless_response(base, index, 0 * gaps, push)[0][sliders] for push in added.T]).T
    _check_unique(base, sliders, friction_forces)
    return _frictionless_response(
        base, index, gaps, load + added @ np.linalg.solve(np.eye(len(sliders)) - friction_forces, forces[sliders])
    )


def _frictionless_response(
    base: ModalBase, index: list[int], gaps: np.ndarray, load: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the same without friction, for gaps (l,)."""
    rigid = [k for k in index if base.links[k].rigid]
    if not base.independent(rigid):
        names = ", ".join(dict.fromkeys(repr(base.links[k].name) for k in rigid))
        raise NumericalFailure(
            f"static equilibrium: {names} hold the same motion, so how they share the load is not unique; need "
            "contacts of finite stiffness, or a spring in series with friction"
        )
    forces = np.zeros(len(base.links))
    forces[index], configuration = core.static_response(base.core_base, index, gaps[index], load)
    return forces, configuration


def _check_unique(base: ModalBase, sliders: list[int], friction_forces: np.ndarray) -> None:
    """Raise NumericalFailure where contacts wedge.

    friction_forces: W (o, o).
    """
    diagonal = np.abs(np.diagonal(friction_forces))
    minors: dict[tuple[int, ...], float] = {(k,): 1 - float(diagonal[k]) for k in range(len(sliders))}
    for count in range(2, len(sliders) + 1):
        for subset in itertools.combinations(range(len(sliders)), count):
            minors[subset] = float(
                np.linalg.det((np.eye(len(friction_forces)) - friction_forces)[np.ix_(subset, subset)])
            )
    for subset, minor in minors.items():
        if not minor > UNIQUE:
            names = ", ".join(repr(base.labels[sliders[k]]) for k in subset)
            raise NumericalFailure(
                f"static equilibrium: friction wedges at the contact {names}: det(I - W) = {minor:.6g}, W being the "
                "contact force that one newton of it brings back by friction, so the equilibrium is not unique; need a "
                "smaller coefficient, for which it is positive"
            )

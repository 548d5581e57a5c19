"""Rest with friction: the static response of a base where some of the links that hold slide.

Their friction goes with their pressure: lambda_o = lambda_o(load) + W lambda_o, W (o, o) the forces that unit friction
makes. Where a minor of I - W is zero contacts wedge, and there is no one state of rest.
"""

from __future__ import annotations

import itertools

import numpy as np

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.levels.build_level import independent
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.levels.static_response import static_response

__all__ = ["rest_with_friction"]

UNIQUE = 1e-11  # of a pressure: less that friction leaves of it is round-off of nothing


def rest_with_friction(
    base: ModalBase, index: list[int], gaps: np.ndarray, load: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Forces (l,) and y (m,) at rest where links hold, with the friction of those that slide."""
    forces, configuration = _at_rest(base, index, gaps, load)
    sliders = [k for k in index if k in base.oblique]
    if not sliders:
        return forces, configuration
    added = base.pushes[:, sliders] - base.directions[:, sliders]
    own = np.array([_at_rest(base, index, 0 * gaps, push)[0][sliders] for push in added.T]).T
    _check_unique(base, sliders, own)
    return _at_rest(base, index, gaps, load + added @ np.linalg.solve(np.eye(len(sliders)) - own, forces[sliders]))


def _at_rest(base: ModalBase, index: list[int], gaps: np.ndarray, load: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same without friction, of gaps (l,)."""
    held = [k for k in index if base.links[k].rigid]
    if not independent(base, held):
        names = ", ".join(dict.fromkeys(repr(base.links[k].name) for k in held))
        raise NumericalFailure(
            f"static equilibrium: {names} hold the same motion, so how they share the load is not unique; need "
            "contacts of finite stiffness, or a spring in series with friction"
        )
    closed_directions = base.closed_directions(index, gaps[index])
    along, configuration = static_response(base, closed_directions, load)
    return base.contact_forces(closed_directions, along, base.gaps_at(configuration, gaps)), configuration


def _check_unique(base: ModalBase, sliders: list[int], own: np.ndarray) -> None:
    """Refuse friction under which contacts wedge: W (o, o)."""
    alone = np.abs(np.diagonal(own))
    minors: dict[tuple[int, ...], float] = {(k,): 1 - float(alone[k]) for k in range(len(sliders))}
    for count in range(2, len(sliders) + 1):
        for chosen in itertools.combinations(range(len(sliders)), count):
            minors[chosen] = float(np.linalg.det((np.eye(len(own)) - own)[np.ix_(chosen, chosen)]))
    for chosen, minor in minors.items():
        if not minor > UNIQUE:
            names = ", ".join(repr(base.label(sliders[k])) for k in chosen)
            raise NumericalFailure(
                f"static equilibrium: friction wedges at the contact {names}: det(I - W) = {minor:.6g}, W being the "
                "contact force that one newton of it brings back by friction, so the equilibrium is not unique; need a "
                "smaller coefficient, for which it is positive"
            )

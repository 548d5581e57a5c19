"""How far a body turns between its interface points, which the linear body does not follow."""

import math
import warnings

import exudyn as exu
import numpy as np
import pytest
from helpers.body_runs import TRAPEZOIDAL, settings

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, PositionInterface, RigidInterface

pytestmark = pytest.mark.usefixtures("quiet_exudyn")

END = 0.1  # s


def bar(directions, held):
    """Two masses, at points ax, ay, .. and bx, by, .. that move in these directions; held: to the ground by springs."""
    n = directions
    K = 1e5 * np.kron(np.array([[1.0, -1.0], [-1.0, 1.0]]), np.diag([1.0] + [0.0] * (n - 1)))
    names = [f"{end}{'xyz'[k]}" for end in "ab" for k in range(n)]
    return mp.LinearStructure(np.eye(2 * n), K + held * np.eye(2 * n), points={name: i for i, name in enumerate(names)})


def position(end, place, rigid=False):
    names = [f"{end}{'xyz'[k]}" for k in range(len(place))]
    return RigidInterface(place, names, [None] * {2: 1, 3: 3}[len(place)]) if rigid else PositionInterface(place, names)


def told(structure, interface, velocity):
    """Warnings of a run in which nothing acts on the body."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    model = mp.MultiPhiModel(structure, modes="all")
    CreateMultiPhiBody(mbs, model, "bar", velocity=velocity, interface=interface, matchedStepSize=END / 20)
    mbs.Assemble()
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        mbs.SolveDynamic(settings(END / 20, END), solverType=TRAPEZOIDAL)
    sentences = [str(each.message) for each in seen if issubclass(each.category, mp.MultiPhiWarning)]
    assert [f"{sentence} (body 'bar')" for sentence in mbs.variables["multiPhi"]["bar"].warnings] == sentences
    return sentences


@pytest.mark.parametrize("rigid", [False, True])
@pytest.mark.parametrize(("length", "across"), [(0.5, 1), (2000.0, 1), (0.5, -1), (0.5, 2), (2e-3, 2)])
@pytest.mark.parametrize("degrees", [4.9, -5.1, 24.0])
def test_a_line_between_two_interface_points_that_turns_is_told(degrees, length, across, rigid):
    directions, axis = (2 if across == 1 else 3), abs(across)
    middle, along = np.arange(directions) * length, length * np.eye(directions)[0]
    places = {end: middle + sign * along / 2 for end, sign in (("a", -1), ("b", 1))}
    speed = np.zeros((2, directions))
    speed[:, axis] = np.array([-0.5, 0.5]) * length * math.tan(math.radians(degrees)) / END
    interface = {end: position(end, place, rigid) for end, place in places.items()}
    sentences = told(bar(directions, 0.0), interface, speed.ravel() + 3 * length)  # moved as a whole as well
    if abs(degrees) < 5:
        assert not sentences
    else:
        (sentence,) = sentences
        assert f"turning: the line between 'a' and 'b' turned by {abs(degrees):.3g} degrees" in sentence
        assert "beyond 5 degrees" in sentence


@pytest.mark.parametrize("rigid", [False, True], ids=["position", "rigid, without rotations"])
def test_one_position_of_a_body_that_is_free_to_move_does_not_show_how_far_it_turns(rigid):
    one, still = {"a": position("a", (0.0, 0.0), rigid)}, np.zeros(4)
    (sentence,) = told(bar(2, 0.0), one, still)
    assert "'a' is the only position" in sentence
    assert "add a second PositionInterface" in sentence
    assert not told(bar(2, 1e3), one, still)
    assert not told(bar(2, 0.0), {"ax": "ax", "by": "by"}, still)


def test_points_at_one_place_show_no_line():
    place = np.array([0.1, 0.3])
    both = {"a": position("a", place), "b": position("b", place * (1 + 1e-15))}
    assert not told(bar(2, 1e3), both, np.array([0.0, 0.01, 0.01, 0.0]))

"""Impacts with friction to which Coulomb's law has several answers: a run that meets one says so."""

import warnings

import numpy as np
import pytest

import multiphi_exudyn as mp


def struck(coupling, friction, *, gap=0.1, speed=(0.0, -1.0, -1.0), weight=0.0, **given):
    """A body of mass 1 along x, y, z, coupled by xy, xz, yz, that meets a floor (y, rough along x) and a wall (z)."""
    mass = np.eye(3)
    mass[(0, 0, 1), (1, 2, 2)] = mass[(1, 2, 2), (0, 0, 1)] = coupling
    structure = mp.LinearStructure(mass, np.zeros((3, 3)), points={"x": 0, "y": 1, "z": 2})
    wall = {"restitution": given["restitution"]} if "restitution" in given else {}
    floor = mp.UnilateralContact("floor", "y", 0.0 if weight else gap, friction=friction, tangential="x", **given)
    model = mp.MultiPhiModel(structure, [floor, mp.UnilateralContact("wall", "z", gap, **wall)], modes="all")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mp.MultiPhiWarning)
        return mp.simulate(model, 0.2, velocity=speed, loads=[mp.ConstantLoad("y", -weight)] if weight else ())


def told(run):
    return [text for text in run.warnings if text.startswith("several impacts: ")]


TOGETHER = (0.8, 0.0, -0.4)  # three answers where both are struck with 1 m/s
HELD = (0.8, 0.8, 0.6)  # and where the floor holds the body and the wall is struck


class TestSeveralAnswers:
    @pytest.mark.parametrize("gap", [0.1, 0.0])
    def test_are_told_where_both_are_struck(self, gap):
        (text,) = told(struck(TOGETHER, 1.5, gap=gap))
        assert "'floor' (1.5), 'wall' (0)" in text
        assert f"t = {gap:g} s" in text
        assert "3 answers" in text

    @pytest.mark.parametrize(
        ("coupling", "friction", "given"),
        [
            (TOGETHER, 0.5, {}),
            (TOGETHER, 1.2, {}),
            ((0.4, 0.0, -0.4), 1.5, {}),
            (TOGETHER, 1.5, {"speed": (0.0, -1.0, -0.9)}),  # one after the other
            (TOGETHER, 1.5, {"stiffness": 1e4}),
            (HELD, 0.5, {"speed": (0.0, 0.0, -1.0), "weight": 1.0}),
        ],
    )
    def test_are_not_where_there_is_one(self, coupling, friction, given):
        assert not told(struck(coupling, friction, **given))

    def test_levels_that_no_impact_begins_in_may_have_more_coordinates(self):
        """On the floor the body strikes the wall; then it is lifted, and moves as it has not before any impact."""
        structure = mp.LinearStructure(np.eye(3), np.zeros((3, 3)), points={"x": 0, "y": 1, "z": 2})
        floor = mp.UnilateralContact("floor", "y", 0.0, friction=0.2, tangential="x")
        model = mp.MultiPhiModel(structure, [floor, mp.UnilateralContact("wall", "z", 0.1)], modes="all")
        lift = mp.SampledLoad("y", [0.0, 0.5, 0.6, 1.0], [-1.0, -1.0, 1.0, 1.0])
        run = mp.simulate(model, 1.0, velocity=[0.0, 0.0, -1.0], loads=[lift])
        kinds = [(event.contact, event.kind) for event in run.events]
        assert kinds == [("floor", "close"), ("wall", "close"), ("wall", "open"), ("floor", "open")]
        assert run.status == "ok"
        assert not told(run)

"""A force law that the motion drives out of its span is told: its name, the time, and how far it went."""

import re

import numpy as np
import pytest

import multiphi_exudyn as mp

TOLD = re.compile(
    r"law span: force law '(.*)' (?:leaves|starts outside) its span "
    r"\((.*), (.*)\) at t = (.*) s and reaches (.*) at t = (.*?) s"
)


def electrode(damping=0.1):
    """A switch that an electrostatic force pulls in: beyond the span of the law it grows for ever."""
    structure = mp.LinearStructure([[1.0]], [[1.0]], [[damping]], points={"x": 0})
    law = mp.ForceLaw("x", lambda q: -0.2 / (1 - q) ** 2, span=(-0.2, 0.9), tolerance=1e-3, name="electrode")
    return mp.MultiPhiModel(structure, [law])


def told(run):
    found = [TOLD.match(sentence) for sentence in run.warnings if sentence.startswith("law span")]
    assert len(found) <= 1
    return (found[0][1], *map(float, found[0].groups()[1:])) if found else None


class TestLeaving:
    @pytest.mark.parametrize("end", [4.0, 20.0])
    def test_is_told_with_time_and_place(self, end):
        run = mp.simulate(electrode(), end)
        name, low, high, time, place, when = told(run)
        assert (name, low, high, when) == ("electrode", -0.2, 0.9, end)
        assert run.at("x", time) == pytest.approx(0.9, abs=1e-4)
        assert place == pytest.approx(run.at("x", end), rel=1e-5)
        assert place > 1e5

    def test_names_the_law_where_the_motion_overflows(self):
        run = mp.simulate(electrode(), 100.0)
        assert run.status == "failed"
        assert "not finite" in run.message
        assert "'electrode' (-0.2, 0.9)" in run.message

    @pytest.mark.parametrize("side", [1.0, -1.0])
    def test_of_a_table_is_told_on_either_side(self, side):
        """Also where one straight line is the whole law, so that no event tells of it."""
        structure = mp.LinearStructure([[1.0]], [[0.0]], points={"x": 0})
        law = mp.ForceLaw("x", ([-1.0, 2.0], [-4.0, 8.0]), name="line")
        run = mp.simulate(mp.MultiPhiModel(structure, [law]), 30.0, velocity=[5.0 * side])
        name, low, high, time, place, _ = told(run)
        edge = 2.0 if side > 0 else -1.0
        assert (name, low, high) == ("line", -1.0, 2.0)
        assert time == pytest.approx(np.arcsin(edge * side * 2.0 / 5.0) / 2.0, abs=1e-5)
        assert abs(place) == pytest.approx(2.5, rel=0.02)

    @pytest.mark.parametrize("side", [1.0, -1.0])
    def test_is_not_told_of_a_law_that_is_no_force_there(self, side):
        """A ball that flies free of a Hertzian contact, and is thrown beyond the other end."""
        structure = mp.LinearStructure([[1.0]], [[0.0]], points={"x": 0})
        places = (-0.2, 0.1) if side > 0 else (-0.1, 0.2)
        law = mp.ForceLaw("x", lambda q: side * 1e3 * np.maximum(side * q, 0.0) ** 1.5, span=places, tolerance=1e-3)
        model = mp.MultiPhiModel(structure, [law])
        flown = mp.simulate(model, 5.0, displacement=[-0.1 * side], velocity=[0.5 * side])
        assert -side * flown.at("x", 5.0) > 1.0
        assert flown.status == "ok"
        assert told(flown) is None
        thrown = mp.simulate(model, 5.0, displacement=[-0.1 * side], velocity=[5.0 * side])
        assert abs(told(thrown)[4]) > 0.1

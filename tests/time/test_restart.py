"""A run goes on from any instant of another one: what round-off left of a gap is no start inside a stop."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from strategies import cases

from multiphi_exudyn import (
    ConstantLoad,
    LinearStructure,
    MultiPhiModel,
    MultiPhiValueError,
    UnilateralContact,
    simulate,
)


@settings(derandomize=True, max_examples=15, deadline=None)
@given(cases(law=("rigid", "mixed"), modes="all", damping=("none", "modal", "rayleigh")), st.floats(0, 1))
def test_is_never_refused_in_contact_or_at_an_event(case, share):
    run = simulate(case.model, case.t_end, case.displacement, case.velocity, case.loads, compiled=False)
    events = [event.time for event in (*run.events[:1], *run.events[-2:])]
    for t in {run.t_end, *events, share * run.t_end}:
        again = simulate(
            case.model, 0.02 * case.t_end, run.displacement(t), run.velocity(t), case.loads, compiled=False
        )
        assert again.status == "ok", again.message


@pytest.mark.parametrize("power", [-40, 0, 40])
@pytest.mark.parametrize("inside", [1e-9, 1e-6])
def test_a_start_inside_a_stop_is_still_refused(inside, power):
    length = 2.0**power
    structure = LinearStructure(np.eye(2), np.diag([1.0, 100.0]))
    model = MultiPhiModel(structure, [UnilateralContact("stop", [0.0, 1.0], 0.0)], modes="all")
    with pytest.raises(MultiPhiValueError, match="inside the rigid contact 'stop'"):
        simulate(model, 1.0, displacement=length * np.array([1.0, -inside]), velocity=length * np.ones(2))


def test_round_off_of_what_the_load_or_the_velocity_or_another_gap_makes_is_in_touch():
    structure = LinearStructure([[1.0]], [[4.0]], points={"m": 0})
    alone = [UnilateralContact("stop", "m", 0.0)]
    other = [*alone, UnilateralContact("far", {"m": -1.0}, 1.0)]
    for stops, velocity, loads in (
        (alone, [1.0], ()),
        (alone, None, [ConstantLoad("m", 4.0)]),
        (other, None, ()),
    ):
        run = simulate(MultiPhiModel(structure, stops, modes="all"), 1.0, [-1e-17], velocity, loads)
        assert run.status == "ok"
    assert_allclose(run.at("m", math.pi / 4), 0, atol=1e-16)

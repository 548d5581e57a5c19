"""Pieces of many channels together are those that the channels have one by one."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from small_structures import chain

import multiphi_exudyn as mp
from multiphi_exudyn.events.excitation.excitation import Excitation
from multiphi_exudyn.events.excitation.pieces import Pieces

GRID = np.linspace(0.5, 2.0, 7)
SAMPLES = mp.SampledLoad("m1", GRID, np.cos(GRID))
LOADS = {
    "samples": [SAMPLES],
    "samples that do not meet": [SAMPLES, mp.SampledLoad("m0", [0.1, 1.0, 1.3], [0.0, 2.0, 1.0])],
    "harmonic": [mp.HarmonicLoad("m1", 2.0, 0.3, 0.4)],
    "harmonics of one frequency": [mp.HarmonicLoad("m1", 2.0, 0.3), mp.HarmonicLoad("m2", 1.0, 0.3, 1.0)],
    "harmonic and samples": [mp.HarmonicLoad("m1", 2.0, 0.3), SAMPLES],
    "sweep": [mp.SweepLoad("m1", 1.0, 1.0, 9.0, 2.0), SAMPLES],
    "function": [mp.FunctionLoad("m1", lambda t: np.exp(-t)), SAMPLES],
    "moving stop": [mp.StopMotion("stop", mp.Harmonic(0.05, 0.7)), SAMPLES],
}


@pytest.mark.parametrize("loads", LOADS.values(), ids=LOADS)
def test_terms_are_those_of_the_channels_at_the_start_of_every_piece(loads):
    model = mp.MultiPhiModel(chain(3), [mp.UnilateralContact("stop", "m2", 0.1)], modes="all")
    excitation = Excitation.of(model, loads, 3.0)
    pieces = Pieces(excitation.histories, 0.0, 3.0)
    known = set()
    for first in range(0, len(pieces), 5):
        for places, terms in pieces.terms(first, min(first + 5, len(pieces))):
            for k, place in enumerate(places.tolist()):
                known.add(place)
                drive = excitation.drive(float(pieces.starts[place]))
                assert drive.until == pieces.ends[place]
                assert [rate for rate, _ in drive.terms] == [rates[k] for rates, _ in terms]
                for (_, expected), (_, found) in zip(drive.terms, terms, strict=True):
                    assert_array_equal(found[k], expected)
    assert known == set(range(len(pieces)))
    assert pieces.starts[0] == 0.0
    assert_array_equal(pieces.starts[1:], pieces.ends[:-1])
    assert pieces.starts[-1] < 3.0 <= pieces.ends[-1]


FIRST = (mp.HarmonicLoad("m1", 2.0, 0.3), mp.ConstantLoad("m0", 0.2))
NEXT = {
    "another course": [mp.HarmonicLoad("m1", 1.0, 0.7, 0.2), mp.ConstantLoad("m0", 0.2)],
    "another kind of course": [mp.SampledLoad("m1", 5 * GRID, np.cos(GRID)), mp.ConstantLoad("m0", 0.2)],
    "another place": [mp.HarmonicLoad("m2", 2.0, 0.3), mp.ConstantLoad("m0", 0.2)],
    "another constant load": [mp.HarmonicLoad("m1", 2.0, 0.3), mp.ConstantLoad("m0", -0.1)],
    "a moving stop": [mp.StopMotion("stop", mp.Harmonic(0.05, 0.7)), mp.ConstantLoad("m0", 0.2)],
}


class TestLevelsKeptForTheNextRun:
    @staticmethod
    def model():
        stop = mp.UnilateralContact("stop", "m2", 0.1, 50.0)
        return mp.MultiPhiModel(chain(3, stiffness=10.0, damping=mp.ModalDamping([0.01])), [stop], modes=2)

    @pytest.mark.parametrize("loads", NEXT.values(), ids=NEXT)
    def test_are_of_no_consequence(self, loads):
        kept, times = self.model(), np.linspace(0.0, 8.0, 101)
        mp.simulate(kept, 8.0, velocity=[0.0, 0.0, -1.0], loads=FIRST)
        found, expected = (
            mp.simulate(model, 8.0, velocity=[0.0, 0.0, -1.0], loads=loads) for model in (kept, self.model())
        )
        assert len(found.events) > 1
        assert found.events == expected.events
        assert found.warnings == expected.warnings
        assert_array_equal(found.displacement(times), expected.displacement(times))

    def test_a_run_under_way_keeps_its_own_loads(self):
        model, times = self.model(), np.linspace(0.0, 8.0, 101)
        run = mp.simulate(model, 8.0, velocity=[0.0, 0.0, -1.0], loads=FIRST)
        expected = run.displacement(times), run.energy(times)
        mp.simulate(model, 8.0, velocity=[0.0, 0.0, -1.0], loads=NEXT["another place"])
        assert_array_equal(run.displacement(times), expected[0])
        assert_array_equal(run.energy(times), expected[1])
        assert abs(run.ledger.residual) < 1e-12 * run.ledger.work_of_loads

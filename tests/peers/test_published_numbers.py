"""Numbers that others have published, each beside its source: validation cases of other codes, and what they measured.

Where a source gives fewer digits than the closed form behind it, both are here.
"""

import math

import numpy as np
import pytest

import multiphi_exudyn as mp
from reference_models.bars import elastic_bar


class TestMassOnAStop:
    """code_aster, validation case SDND101 (V5.01.101): 100 kg on 1e4 N/m meet a stop of 1e6 N/m at 1 m/s.

    While it touches, spring and stop are in parallel: w = sqrt((k + k_c)/m), pi/w long, at most k_c v/w.
    Its test file asks for 0.03126 s, 9950 N, 198.05 N s and -1 m/s, the second impact's largest force at 0.361 s.
    """

    MASS, SPRING, STOP, SPEED = 100.0, 1e4, 1e6, 1.0

    @pytest.fixture(scope="class")
    @classmethod
    def run(cls):
        structure = mp.LinearStructure([[cls.MASS]], [[cls.SPRING]], points={"mass": 0})
        stop = mp.UnilateralContact("stop", {"mass": -1.0}, 0.0, cls.STOP)
        return mp.simulate(mp.MultiPhiModel(structure, [stop], modes="all"), 0.5, velocity=[cls.SPEED])

    def test_contacts_last_as_long_as_printed(self, run):
        contacts = run.contact_intervals("stop")
        assert len(contacts) == 2
        for begin, end in contacts:
            assert end - begin == pytest.approx(0.03126001526812, abs=5e-15)
        assert sum(contacts[1]) / 2 == pytest.approx(0.361, abs=5e-4)

    def test_the_largest_force_is_as_printed(self, run):
        for begin, end in run.contact_intervals("stop"):
            assert run.contact_force("stop", (begin + end) / 2) == pytest.approx(9950.371902, abs=5e-7)

    def test_impulse_and_speed_are_as_printed(self, run):
        for begin, end in run.contact_intervals("stop"):
            assert run.contact_impulse("stop", begin, end) == pytest.approx(198.05, rel=1e-3)  # what it allows itself
            assert float(run.velocity(begin)[0]) == pytest.approx(self.SPEED, rel=1e-12)


def test_a_pad_stops_where_code_aster_says():
    """Its validation case SDND100 (V5.01.100): 1 kg on 1e4 N/m, friction 1 N, released at 0.85 mm.

    Two displacements at 45 degrees: what it prints is the motion times cos 45. It rests after four half cycles.
    """
    structure = mp.LinearStructure([[1.0]], [[1e4]], points={"pad": 0})
    model = mp.MultiPhiModel(structure, [mp.Friction("floor", "pad", 1.0)], modes="all")
    run = mp.simulate(model, 1.0, displacement=[0.85e-3])
    turns = math.cos(math.pi / 4) * np.asarray(run.at("pad", math.pi / 100 * np.arange(1, 5)))
    assert turns == pytest.approx([-4.596e-4, 3.182e-4, -1.768e-4, 3.536e-5], abs=5e-8)
    assert [event.kind for event in run.events][-1] == "stick"
    assert run.events[-1].time == pytest.approx(4 * math.pi / 100, rel=1e-12)


class TestImpactingBar:
    """Siconos, example ImpactingBar and its reference file: a steel bar meets a rigid floor at 0.1 m/s.

    210 GPa, 7800 kg/m3, 3.14e-4 m2, 100 nodes 10 mm apart (so 0.99 m long), 50 um above the floor, restitution 0,
    implicit midpoint with 2 us. Exact: contact for 2 L/c = 381.6 us with rho c A v = 1270.8 N, then back with 0.1 m/s.
    """

    MODULUS, DENSITY, AREA, SIZE, SPEED, HEIGHT = 210e9, 7800.0, 3.14e-4, 0.01, 0.1, 5e-5

    @pytest.fixture(scope="class")
    @classmethod
    def run(cls):
        bar = elastic_bar(99, 99 * cls.SIZE, stiffness=cls.MODULUS * cls.AREA, density=cls.DENSITY * cls.AREA)
        model = mp.MultiPhiModel(bar, [mp.UnilateralContact("floor", "bottom", 0.0)], modes="all")
        start = {"displacement": np.full(100, cls.HEIGHT), "velocity": np.full(100, -cls.SPEED)}
        return mp.simulate(model, 1.5e-3, **start)

    def test_the_floor_presses_as_it_should(self, run):
        """Mean from 560 to 610 us, where the reference file's steps scatter from 1268.6 to 1272.0 N."""
        mean = run.contact_impulse("floor", 5.6e-4, 6.1e-4) / 0.5e-4
        exact = math.sqrt(self.MODULUS * self.DENSITY) * self.AREA * self.SPEED
        assert mean == pytest.approx(exact, rel=1e-4)
        assert mean == pytest.approx(1270.7, rel=1e-3)

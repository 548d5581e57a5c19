"""The size of a motion, which the loop looks at on its way where truncation takes much, and nobody else then has to."""

import math

import numpy as np
import pytest
from small_structures import chain, stop

import multiphi_exudyn as mp

pytestmark = pytest.mark.filterwarnings("ignore::multiphi_exudyn.MultiPhiWarning")

END = 0.5
BENT = 3e-3 * np.arange(18.0)
TIMES = np.linspace(0.0, END, 301)
LOADS = {
    "free": (),
    "static": (mp.ConstantLoad("m9", 2.0),),
    "harmonic": (mp.HarmonicLoad("m9", 5.0, 12.0),),
    "samples": (mp.SampledLoad("m9", TIMES, 5.0 * np.sin(80.0 * TIMES)),),
}


def model(modes, stiffness=1e6):
    structure = chain(18, mass=0.5, stiffness=2e4, damping=mp.ModalDamping(0.02))
    return mp.MultiPhiModel(structure, [stop("m17", 5e-3, stiffness)], modes=modes)


def runs(given, count=2, **options):
    """The same run several times."""
    found = [mp.simulate(given, END, displacement=BENT, **options) for _ in range(count)]
    assert {run.status for run in found} == {"ok"}
    return found


def sizes(run):
    """What the loop has seen of a run, its energy where a load acts; None where it has not seen all."""
    seen = run.ending.record.trajectory.truncation
    if math.isnan(seen.mean_square):
        return None
    return seen.mean_square, 0.0 if seen.is_isolated else seen.largest_energy


def recorded(run, end):
    """The same from the record."""
    square, energy = run.segments.sizes(end)
    return square, 0.0 if run.ending.record.trajectory.truncation.is_isolated else energy


@pytest.mark.parametrize("stiffness", [1e6, math.inf])
@pytest.mark.parametrize("loads", LOADS)
def test_what_the_loop_sees_is_what_the_record_tells(loads, stiffness):
    first, second = runs(model(4, stiffness), loads=LOADS[loads])
    for run in (first, second):
        assert sizes(run) == pytest.approx(recorded(run, END), rel=1e-9)
    assert first.warnings == second.warnings
    assert any(sentence.startswith("truncation:") for sentence in second.warnings)

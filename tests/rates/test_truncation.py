"""Truncation: the indicator sees what levels could not hold, and a tolerance turns into numbers of modes."""

import dataclasses
import functools
import math

import numpy as np
import pytest
from scipy.stats import spearmanr

import multiphi_exudyn as mp
from reference_models.rig import initial_displacement, rig_beam, rig_contact, rig_damping

END = 0.3


@functools.cache
def rig(stiffness):
    """The rig with all modes, its start, and its answer at node2 and node3."""
    structure = mp.planar_beam(rig_beam(), elements=57, damping=rig_damping())
    model = mp.MultiPhiModel(structure, [rig_contact(stiffness)], modes="all")
    bent = model.static_equilibrium({"node3": 1.0})
    start = bent * initial_displacement() / float(structure.row("node3") @ bent)
    return model, start, histories(mp.simulate(model, END, displacement=start))


def histories(trajectory):
    times = np.linspace(0, END, 1501)
    return np.array([trajectory.at(point, times) for point in ("node2", "node3")])


def error(trajectory, answer):
    return np.max(np.linalg.norm(histories(trajectory) - answer, axis=1) / np.linalg.norm(answer, axis=1))


def test_the_indicator_ranks_truncated_answers_and_is_near_their_error():
    model, start, answer = rig(1e6)
    found = []
    for modes in (3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24):
        run = mp.simulate(dataclasses.replace(model, modes=modes), END, displacement=start)
        found.append((mp.truncation_indicator(run), error(run, answer)))
    indicated, true = np.array(found).T
    assert spearmanr(indicated, true)[0] > 0.95
    assert np.all(indicated > true)
    assert np.all(indicated[true > 1e-5] < 6 * true[true > 1e-5])


@pytest.mark.parametrize("tolerance", [0.3, 0.05, 0.02, 0.003, 1e-4])
def test_a_tolerance_is_kept(tolerance):
    model, start, answer = rig(1e6)
    run = mp.simulate(dataclasses.replace(model, modes=mp.Tolerance(tolerance)), END, displacement=start)
    assert (run.status, run.message) == ("ok", "")
    assert mp.truncation_indicator(run) <= tolerance
    assert error(run, answer) <= tolerance
    assert isinstance(run.model.modes, mp.UpTo)


def test_a_tolerance_out_of_reach_is_said_and_the_answer_has_all_modes_allowed():
    model, start, _ = rig(math.inf)
    run = mp.simulate(dataclasses.replace(model, modes=mp.Tolerance(0.01, most=8)), END, displacement=start)
    assert run.status == "ok"
    assert run.model.level(()).modes == 8
    (told,) = (sentence for sentence in run.warnings if sentence.startswith("truncation: the indicator is 0."))
    assert "with 8 modes, the tolerance 0.01" in told


class TestToleranceIsKept:
    """Runs whose indicator is far below their error: many events pass on what each of them loses."""

    END = 0.25

    def error(self, run, whole):
        """NRMSE over the run, the worse of two points."""
        t = np.linspace(0, self.END, 800)
        pairs = [(run.at(point, t), whole.at(point, t)) for point in ("p", "tip")]
        return max(np.linalg.norm(found - expected) / np.linalg.norm(expected) for found, expected in pairs)

    def beam(self, elements, at, stiffness, damping, gap=0.0, height=0.006):
        section = mp.Section.rectangle(0.0, 0.5, width=0.03, height=height, youngs_modulus=70e9, density=2700.0)
        ratios = mp.ModalDamping([0.01, 0.005], beyond=0.005) if damping else mp.ModalDamping(0.002)
        structure = mp.planar_beam(mp.Beam([section], {"p": at, "tip": 0.5}), elements, damping=ratios)
        return structure, [mp.UnilateralContact("c", "p", gap, stiffness, damping)]

    @pytest.mark.parametrize("error", [0.02, 0.05])
    @pytest.mark.parametrize(
        ("elements", "at", "stiffness", "damping", "pull", "frequency"),
        [
            (13, 0.349038, np.inf, 0.0, 0.0, 42.37462),
            (20, 0.413784, 7655639.5, 276.69, -20.0, 0.0),
            (18, 0.3, 1e6, 0.0, -20.0, 0.0),
            (16, 0.25, 5e6, 5.0, 0.0, 30.0),
        ],
    )
    def test_or_told(self, elements, at, stiffness, damping, pull, frequency, error):
        structure, contacts = self.beam(elements, at, stiffness, damping)
        whole, chosen = (mp.MultiPhiModel(structure, contacts, modes=m) for m in ("all", mp.Tolerance(error)))
        start = whole.static_equilibrium({"tip": pull}) if pull else None
        loads = [mp.HarmonicLoad("tip", 10.0, frequency)] if frequency else []
        expected, run, again = (mp.simulate(m, self.END, start, loads=loads) for m in (whole, chosen, chosen))
        assert self.error(run, expected) <= error
        assert again.warnings == run.warnings
        few = mp.MultiPhiModel(structure, contacts, modes=mp.Tolerance(error, most=10))
        cut = mp.simulate(few, self.END, start, loads=loads)
        assert self.error(cut, expected) <= error or any(text.startswith("truncation: ") for text in cut.warnings)
        again = mp.simulate(few, self.END, start, loads=loads)
        assert [text.split(":")[0] for text in again.warnings] == [text.split(":")[0] for text in cut.warnings]

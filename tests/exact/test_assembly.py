"""An assembly is the structure its parts and ties describe: against whole beams, direct matrices and exact impacts."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
import scipy.sparse
from numpy.testing import assert_allclose
from small_structures import chain

from multiphi_exudyn import (
    Beam,
    Clamp,
    LinearStructure,
    ModalDamping,
    MultiPhiModel,
    RayleighDamping,
    Section,
    UnilateralContact,
    assemble,
    planar_beam,
    simulate,
)
from multiphi_exudyn.mechanics.structure import damping_matrix

CLAMPED = Clamp()
FREE = Clamp(translation=0.0, rotation=0.0)
SAME_FREQUENCIES = 1e-10  # relative; the assembled matrices differ from the direct ones by round-off only
TIED = ({"left.end": 1.0, "right.start": -1.0}, {"left.slope": 1.0, "right.slope": -1.0})


def bar(length, clamp, points, elements):
    section = Section.rectangle(0.0, length, width=0.02, height=0.005, youngs_modulus=2.1e11, density=7850.0)
    return planar_beam(Beam([section], points, clamp=clamp), elements)


def with_slope(beam, at):
    """The beam with one more point, "slope": the rotation beside the deflection of the point ``at``."""
    return replace(beam, points={**beam.points, "slope": int(np.argmax(beam.row(at))) + 1})


def beam_of_halves(ties=TIED):
    left = with_slope(bar(0.3, CLAMPED, {"end": 0.3}, 8), "end")
    right = with_slope(bar(0.3, FREE, {"start": 0.0, "end": 0.3}, 8), "start")
    return assemble({"left": left, "right": right}, ties)


def frequencies(structure):
    mass, stiffness = (m.toarray() if scipy.sparse.issparse(m) else m for m in (structure.mass, structure.stiffness))
    return np.sqrt(np.abs(scipy.linalg.eigh(stiffness, mass, eigvals_only=True)))


def masses(*, sparse=False, damping=None):
    """Two free chains of three and two masses, and the same as one."""
    kind = scipy.sparse.csr_array if sparse else np.asarray
    a, b = chain(3), chain(2, ends=0, mass=2.0, stiffness=5.0)
    return {
        "a": LinearStructure(kind(a.mass), kind(a.stiffness), damping, a.points),
        "b": LinearStructure(b.mass, b.stiffness, damping, b.points),
    }


class TestMatrices:
    def test_two_halves_tied_in_deflection_and_rotation_are_the_whole_beam(self):
        whole = bar(0.6, CLAMPED, {"tip": 0.6}, 16)
        level, united = (MultiPhiModel(s, (), modes="all").level(()) for s in (whole, beam_of_halves()))
        assert_allclose(united.frequencies, level.frequencies, rtol=SAME_FREQUENCIES)

    def test_the_order_of_ties_and_of_parts_changes_nothing(self):
        reference = frequencies(beam_of_halves())
        ties = [{name: -3.0 * c for name, c in tie.items()} for tie in TIED]
        for order in itertools.permutations(ties):
            assert_allclose(frequencies(beam_of_halves(order)), reference, rtol=1e-7)


class TestDamping:
    def test_untied_parts_keep_their_own_modal_ratios(self):
        parts = {"a": chain(3, damping=ModalDamping([0.02, 0.03, 0.04])), "b": chain(2, stiffness=100.0)}
        level = MultiPhiModel(assemble(parts), (), modes="all").level(())
        assert_allclose(level.ratios, [0.02, 0.03, 0.04, 0.0, 0.0], atol=1e-12)

    def test_rayleigh_damping_of_all_parts_is_that_of_the_assembly(self):
        rayleigh = RayleighDamping(0.3, 2e-3)
        tie = [{"a.m2": 1.0, "b.m0": -1.0}]
        own = damping_matrix(assemble(masses(damping=rayleigh), tie))
        assert_allclose(own, damping_matrix(assemble(masses(), tie, rayleigh)), rtol=0, atol=1e-14)


class TestMotion:
    def test_displacements_go_to_the_parts_and_back(self):
        united = beam_of_halves()
        x = np.random.default_rng(3).normal(size=(united.n, 2))
        left, right = united.part("left", x), united.part("right", x)
        assert_allclose(united.together({"left": left[:, 0], "right": right[:, 0]}), x[:, 0], rtol=0, atol=1e-15)
        assert_allclose(left[-2:], right[:2], rtol=0, atol=1e-14)  # deflection and rotation of the joint
        assert_allclose(right[-2], united.row("right.end") @ x, rtol=1e-13)

    @pytest.mark.parametrize("stiffness", [1e4, math.inf], ids=["compliant", "rigid"])
    def test_two_free_masses_exchange_momentum_exactly(self, stiffness):
        parts = {name: LinearStructure([[m]], [[0.0]], points={"x": 0}) for name, m in (("a", 2.0), ("b", 3.0))}
        united = assemble(parts)
        contact = UnilateralContact("clap", {"a.x": 1.0, "b.x": -1.0}, gap=0.5, stiffness=stiffness)
        start = united.together({"a": [-1.0]})  # a falls on b: the clap comes at 0.5 s
        run = simulate(
            MultiPhiModel(united, [contact], modes="all"),
            2.0,
            displacement=0 * start,
            velocity=start,
        )
        after = run.velocity(2.0)
        elastic, plastic = (-1.0 + 2 * 3.0 / 5.0, -2 * 2.0 / 5.0), (-0.4, -0.4)
        expected = plastic if math.isinf(stiffness) else elastic
        assert_allclose([united.part("a", after)[0], united.part("b", after)[0]], expected, atol=1e-9)
        assert_allclose(run.contact_impulse("clap", 0.0, 2.0), 3.0 * -expected[1], rtol=1e-9)
        assert_allclose(run.events[0].time, 0.5, rtol=1e-12)


A = {"a": chain(2)}
BAD = {
    "no parts": (ValueError, "parts: ", ({},)),
    "a list of parts": (TypeError, "parts: ", ([chain(2)],)),
    "a part that is none": (TypeError, "parts['a']: ", ({"a": 3},)),
    "a dot in a name": (ValueError, "parts: ", ({"a.b": chain(2)},)),
    "one tie instead of a list": (TypeError, "ties: ", (A, {"a.m0": 1.0})),
    "a tie that is a name": (TypeError, "tie: ", (A, ["a.m0"])),
    "an unknown point": (ValueError, "ties[0] point: ", (A, [{"m0": 1.0}])),
    "the same tie twice": (ValueError, "ties[1]: ", (A, [{"a.m0": 1.0}, {"a.m0": 2.0}])),
    "a tie of nothing": (ValueError, "ties[0]: ", (A, [{"a.m0": 0.0}])),
    "everything held": (ValueError, "ties: ", (A, [{"a.m0": 1.0}, {"a.m1": 1.0}])),
    "sparse modal": (ValueError, "parts['a'] damping: ", (masses(sparse=True, damping=ModalDamping([0.1])),)),
}


@pytest.mark.parametrize("case", BAD)
def test_assemble_refuses(refused, case):
    kind, begins, given = BAD[case]
    refused(kind, begins, assemble, *given)

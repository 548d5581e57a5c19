"""The model refuses what makes no sense, builds only what is asked for, and starts from the right contacts."""

import dataclasses
import math

import numpy as np
import pytest
import scipy.sparse
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from small_structures import chain, random_model, stop

import multiphi_exudyn.levels.model.level_store
from multiphi_exudyn import ConstantLoad, LevelOverride, LinearStructure, MultiPhiModel, UnilateralContact, simulate


class TestMultiPhiModel:
    @pytest.mark.parametrize(
        ("kind", "changes", "begins"),
        [
            (TypeError, {"structure": np.eye(3)}, "structure: got ndarray"),
            (TypeError, {"modes": 2.0}, "modes: got 2.0"),
            (TypeError, {"modes": True}, "modes: got True"),
            (TypeError, {"modes": "most"}, "modes: got 'most'"),
            (ValueError, {"modes": 0}, "modes: got 0"),
            (ValueError, {"modes": -1}, "modes: got -1"),
            (ValueError, {"contacts": [stop(), stop("m1")]}, "contacts: got the names"),
            (ValueError, {"contacts": [stop("m9")]}, "contact 'stop': point: got 'm9', need one of: m0, m1, m2, m3"),
            (ValueError, {"contacts": [stop({"m0": 0.0})]}, "contact 'stop' direction: got a zero row"),
            (ValueError, {"overrides": {("elsewhere",): LevelOverride()}}, "contact: got 'elsewhere'"),
        ],
    )
    def test_refuses(self, refused, kind, changes, begins):
        given_arguments = {"structure": chain(4), "contacts": [stop()], "modes": 2} | changes
        refused(kind, begins, MultiPhiModel, **given_arguments)

    @pytest.mark.parametrize("modes", [4, 6])
    def test_more_modes_than_a_level_has_are_all_of_them(self, modes):
        m, every = (MultiPhiModel(chain(4), [stop()], modes=r) for r in (modes, "all"))
        assert [m.level(closed).modes for closed in ((), ("stop",))] == [4, 3]
        assert np.array_equal(m.level(("stop",)).squares, every.level(("stop",)).squares)
        assert m.whole

    def test_a_single_name_is_no_set_of_contacts(self, refused):
        refused(TypeError, "closed: got 'stop'", MultiPhiModel(chain(4), [stop()], modes=2).level, "stop")

    @pytest.mark.parametrize("modes", ["all", 2, None])
    def test_is_shown_with_an_indefinite_stiffness_which_its_levels_refuse(self, modes, refused):
        swapped = LinearStructure(np.eye(2), np.array([[1.0, 2.0], [2.0, 1.0]]), None, {"m0": 0})
        m = MultiPhiModel(swapped, [stop()], modes)
        assert repr(m).startswith("<MultiPhiModel: degrees of freedom 2; contacts stop; modes ")
        assert (m.levels_built, m.levels_kept) == (0, 0)
        refused(ValueError, "stiffness: indefinite", m.level)

    def test_levels_are_built_on_first_use_and_kept(self):
        m = MultiPhiModel(chain(4), [stop(), stop("m3", name="other")], modes=2)
        assert m.levels_built == 0
        assert np.array_equal(m.level(("other", "stop")).vectors, m.level(("stop", "other")).vectors)
        assert m.levels_built == 1

    @pytest.mark.parametrize("modes", [3, "all"])
    def test_another_number_of_modes_builds_no_other_base(self, modes, monkeypatch):
        m = MultiPhiModel(chain(6), [stop()], modes=2)
        m.level(("stop",))

        def never(*_):
            raise AssertionError("built anew")

        monkeypatch.setattr(multiphi_exudyn.levels.model.level_store, "build_base", never)
        other = dataclasses.replace(m, modes=modes)
        assert other.level(("stop",)).modes == (5 if modes == "all" else modes)

    def test_another_structure_or_contact_is_built_anew(self):
        m = MultiPhiModel(chain(6), [stop()], modes=2)
        m.level(("stop",))
        for changes in ({"contacts": [stop(gap=0.3)]}, {"structure": chain(6, stiffness=4.0)}):
            other = dataclasses.replace(m, **changes)
            fresh = MultiPhiModel(other.structure, other.contacts, modes=2)
            assert_allclose(other.level(()).omega, fresh.level(()).omega, rtol=1e-14)
            assert_allclose(other.base.gaps, fresh.base.gaps)

    def test_sparse_matrices_of_many_freedoms_give_the_low_modes(self):
        n = 620
        dense = chain(n)
        sparse = LinearStructure(
            scipy.sparse.csr_array(dense.mass), scipy.sparse.csr_array(dense.stiffness), points={"m310": 310}
        )
        contacts = [stop("m310", 0.01)]
        m = MultiPhiModel(sparse, contacts, modes=5)
        assert not m.base.complete
        full = MultiPhiModel(dense, contacts, modes="all")
        for closed in ((), ("stop",)):
            assert_allclose(m.level(closed).omega, full.level(closed).omega[:5], rtol=1e-5)
        assert_allclose(
            m.level(("stop",)).asymptotic_configuration, full.level(("stop",)).asymptotic_configuration, atol=1e-4
        )


class TestStaticEquilibrium:
    @given(st.integers(0, 2**31), st.floats(-30, 30))
    def test_satisfies_equilibrium_and_complementarity(self, seed, force):
        m, random = random_model(seed, kind="mixed")
        m = dataclasses.replace(m, modes="all")
        point = f"m{random.integers(m.structure.n)}"
        x = m.static_equilibrium({point: force})
        rows = np.array([m.structure.row(contact.direction) for contact in m.contacts])
        gaps = rows @ x + m.base.gaps
        residual = m.structure.stiffness @ x - force * m.structure.row(point)
        pushed = np.linalg.lstsq(rows.T, residual, rcond=None)[0]
        scale = max(1.0, abs(force))
        assert_allclose(rows.T @ pushed, residual, atol=1e-9 * scale)
        for contact, gap, reaction in zip(m.contacts, gaps, pushed, strict=True):
            assert reaction >= -1e-9 * scale
            if math.isinf(contact.stiffness):
                assert gap >= -1e-9
                assert abs(gap * reaction) <= 1e-8 * scale
            else:
                assert_allclose(reaction, contact.stiffness * max(0.0, -gap), atol=1e-8 * scale)

    def test_a_run_from_it_under_the_same_load_stays_at_rest(self):
        m = MultiPhiModel(chain(5), [stop("m2", 0.3), stop("m4", 0.5, 40.0, "soft")], modes="all")
        x = m.static_equilibrium({"m4": -2.0})
        run = simulate(m, 20.0, displacement=x, loads=[ConstantLoad("m4", -2.0)])
        assert run.status == "ok"
        assert_allclose(run.displacement(np.linspace(0, 20, 50)), np.tile(x[:, None], 50), atol=1e-9)
        assert [event.kind for event in run.events if event.time > 0] == []

    def test_preload_closes_a_negative_gap(self):
        m = MultiPhiModel(chain(1), [UnilateralContact("soft", "m0", -1.0, 3.0)], modes="all")
        assert_allclose(m.static_equilibrium({}), 3.0 / 4.0)  # k (1 - x) = x

    @pytest.mark.parametrize(
        ("kind", "forces", "begins"),
        [
            (TypeError, [("m0", 1.0)], "forces: got list"),
            (ValueError, {"m7": 1.0}, "point: got 'm7'"),
            (ValueError, {"m0": math.nan}, "direction['m0']: got nan"),
        ],
    )
    def test_refuses(self, refused, kind, forces, begins):
        refused(kind, begins, MultiPhiModel(chain(4), [stop()], modes=2).static_equilibrium, forces)

    def test_needs_balanced_forces_where_nothing_holds_the_structure(self, refused):
        m = MultiPhiModel(chain(4, ends=0), [stop()], modes=2)
        refused(ValueError, "static equilibrium: the structure is free (1", m.static_equilibrium, {"m0": 1.0})

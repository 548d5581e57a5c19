"""The full Exudyn beam: its linearisation, start, energy, contact forces, and how it fails."""

import numpy as np
import pytest
import scipy.linalg
from scipy.signal import cont2discrete

from multiphi_exudyn.exudyn_plugin import linear_structure_from
from multiphi_exudyn.mechanics.beam import Beam, Clamp, PointMass, Section, planar_beam
from multiphi_exudyn.mechanics.contact import UnilateralContact
from reference_models.beam_system import build_beam_system
from reference_models.full_beam import FullBeam, FullBeamSettings
from reference_models.recorder import Recorder

RATIOS = (0.0434, 0.0167, 0.00009, 0.0024)
RIG = Beam(
    [
        Section.rectangle(
            0, 0.5497, width=0.0607, height=3.483e-3, youngs_modulus=43.5e9, density=2700, poisson_ratio=0.33
        )
    ],
    points={"node1": 0.095, "node2": 0.4, "node3": 0.529},
    masses=[PointMass(0.529, 0.213, 9.68e-5)],
)
SUPPORT = UnilateralContact("support", "node2", 1.35e-3, 1e6)
START = {"load_at": "node3", "measured_at": "node3", "displacement": 0.02, "progress": False}
ANCF, EXACT = "ancf", "geometrically-exact"


def modes(structure):
    """Angular frequencies [rad/s], ascending, and mass-normalised modes; low ones to full accuracy."""
    inverse, vectors = scipy.linalg.eigh(structure.mass, structure.stiffness)
    omega = 1 / np.sqrt(inverse[::-1])
    return omega, vectors[:, ::-1] * omega


def ratios_of(omega):
    return np.concatenate([RATIOS, np.full(len(omega) - len(RATIOS), 0.0024)])


def modal_damping(structure):
    omega, phi = modes(structure)
    momenta = structure.mass @ phi
    matrix = (momenta * (2 * ratios_of(omega) * omega)) @ momenta.T
    return (matrix + matrix.T) / 2


def run(t_end, *, contacts=(SUPPORT,), beam=RIG, damped=True, start=START, **settings):
    full = FullBeam(beam, contacts, FullBeamSettings(**settings))
    return full, full.run(t_end, damping=modal_damping(full.structure) if damped else None, **start)


def linear_response(structure, force_at, force, start, time):
    """Modal coordinates (n, k) under a force (k,) that is linear between samples; exact in time."""
    omega, phi = modes(structure)
    zeta, load = ratios_of(omega), phi.T @ structure.row(force_at)
    parts = []
    for w, z, of_force in zip(omega, zeta, load, strict=True):
        system = np.array([[0, 1], [-w * w, -2 * z * w]]), np.array([[0], [of_force]]), np.eye(2), np.zeros((2, 1))
        a, b, _, d, _ = cont2discrete(system, time[1] - time[0], method="foh")
        parts.append((a, b[:, 0], d[:, 0]))
    a, b, d = (np.array(part) for part in zip(*parts, strict=True))
    state = np.column_stack([phi.T @ structure.mass @ start, np.zeros(len(omega))]) - d * force[0]
    eta = np.zeros((len(omega), len(time)))
    for k, f in enumerate(force):
        eta[:, k] = state[:, 0] + d[:, 0] * f
        state = np.einsum("ijk,ik->ij", a, state) + b * f
    return {name: (row @ phi) @ eta for name, row in structure.points.items()}


def difference(one, other, names=("node2", "node3")):
    """Largest relative difference of histories in the 2-norm."""
    return max(np.linalg.norm(one[name] - other[name]) / np.linalg.norm(other[name]) for name in names)


class TestStructure:
    @pytest.mark.parametrize(("kind", "elements", "ceiling"), [(ANCF, 20, 7e-4), (EXACT, 57, 3e-3), (EXACT, 228, 3e-4)])
    def test_frequencies_are_those_of_the_timoshenko_beam(self, kind, elements, ceiling):
        found = modes(FullBeam(RIG, (), FullBeamSettings(kind=kind, elements=elements)).structure)[0]
        expected = modes(planar_beam(RIG, 57))[0]
        np.testing.assert_allclose(found[:4], expected[:4], rtol=ceiling)

    @pytest.mark.parametrize("kind", [ANCF, EXACT])
    def test_sections_masses_overhang_and_clamp_springs_are_those_of_the_description(self, kind):
        steel = {"youngs_modulus": 210e9, "density": 7850, "poisson_ratio": 0.3}
        beam = Beam(
            [
                Section.rectangle(0, 0.3, width=0.04, height=0.006, **steel),
                Section.rectangle(0.3, 0.7, width=0.03, height=0.004, **steel),
            ],
            points={"middle": 0.35, "tip": 0.7},
            masses=[PointMass(0.35, 0.4, 2e-4), PointMass(0.6, 0.2)],
            clamp=Clamp(translation=2e4, rotation=300.0),
        )
        structure = FullBeam(beam, (), FullBeamSettings(kind=kind, elements=80)).structure
        expected = planar_beam(beam, 80)
        np.testing.assert_allclose(modes(structure)[0][:5], modes(expected)[0][:5], rtol=1.5e-3)
        for name in beam.points:
            found, wanted = (s.row(name) @ np.linalg.solve(s.stiffness, s.row("tip")) for s in (structure, expected))
            assert found == pytest.approx(wanted, rel=1e-3)

    @pytest.mark.parametrize("kind", [ANCF, EXACT])
    def test_damping_in_exudyn_has_the_modal_ratios_asked_for(self, kind):
        full = FullBeam(RIG, (), FullBeamSettings(kind=kind, elements=12))
        matrix = full.structure.coordinates @ modal_damping(full.structure) @ full.structure.coordinates.T
        system = build_beam_system(full.beams, full.settings, damping=matrix)
        damped, _ = linear_structure_from(system.mbs, {})
        omega, phi = modes(damped)
        np.testing.assert_allclose(
            phi.T @ damped.damping @ phi, np.diag(2 * ratios_of(omega) * omega), atol=1e-8 * omega[-1]
        )
        np.testing.assert_allclose(
            np.diag(phi.T @ damped.damping @ phi)[:6], (2 * ratios_of(omega) * omega)[:6], rtol=1e-6
        )


class TestFreeFlight:
    def test_energy_and_dissipation_balance(self):
        _, found = run(0.06, contacts=(), step=1e-4)
        assert found.balance.dissipated > 0.1 * found.balance.initial
        assert found.balance.final + found.balance.dissipated == pytest.approx(found.balance.initial, rel=3e-4)

    def test_small_amplitudes_converge_to_the_linear_damped_beam(self):
        """Order 2 mode by mode; 1.5 to 2 for a release, whose higher modes are resolved one after another."""
        errors = []
        for step in (2e-4, 1e-4, 5e-5):
            start = START | {"displacement": 1e-4}
            full, found = run(
                0.2,
                contacts=(),
                elements=6,
                step=step,
                output_step=1.6e-3,
                newton_tolerance=1e-6,
                start=start,
            )
            static = np.linalg.solve(full.structure.stiffness, full.structure.row("node3"))
            static *= 1e-4 / (full.structure.row("node3") @ static)
            exact = linear_response(full.structure, "node3", np.zeros(len(found.time)), static, found.time)
            errors.append(difference(found.points, exact))
        assert errors[-1] < 1e-5
        assert np.log2(errors[0] / errors[1]) > 1.4
        assert np.log2(errors[1] / errors[2]) > 1.7


@pytest.fixture(scope="module")
def impact():
    return run(0.1, step=2e-5, output_step=2e-5)


class TestContact:
    def test_the_linear_beam_under_the_reported_force_moves_as_the_full_one(self, impact):
        full, found = impact
        static = np.linalg.solve(full.structure.stiffness, full.structure.row("node3"))
        static *= 0.02 / (full.structure.row("node3") @ static)
        force = found.contact_force["support"]
        expected = linear_response(full.structure, "node2", force, static, found.time)
        assert difference(found.points, expected) < 5e-3
        without = linear_response(full.structure, "node2", 0 * force, static, found.time)
        assert difference(found.points, without) > 0.3


class TestFailures:
    def test_a_solver_that_does_not_converge_is_a_status_with_its_time(self):
        _, found = run(0.1, newton_tolerance=1e-15)
        assert found.status == "failed"
        assert "step size" in found.message
        assert f"at {found.failed_at:.6g} s" in found.message
        assert found.failed_at < 0.1
        assert len(found.points["node3"]) == len(found.time)


class TestLastSample:
    """The last sample belongs to the run, wherever the sum of its steps ends."""

    @pytest.mark.parametrize("short", [1e-13, 1e-10, 1e-7, -1e-10])
    def test_a_sum_of_steps_that_misses_the_end_by_round_off(self, monkeypatch, short):
        keep = Recorder.__call__
        monkeypatch.setattr(Recorder, "__call__", lambda self, mbs, t: keep(self, mbs, t * (1 - short)))
        _, found = run(0.01, elements=4, step=1e-4)
        np.testing.assert_array_equal(found.time, 1e-4 * np.arange(101))
        assert all(len(found.points[name]) == 101 and np.all(np.isfinite(found.points[name])) for name in RIG.points)
        assert len(found.contact_force["support"]) == 101

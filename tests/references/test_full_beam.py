"""The full Exudyn beam: its linearisation, start, energy, contact forces, and how it fails."""

import signal
from dataclasses import replace

import exudyn as exu
import numpy as np
import pytest
import scipy.linalg
from scipy.signal import cont2discrete

import multiphi_exudyn as mp
from multiphi_exudyn.errors import MultiPhiValueError
from multiphi_exudyn.exudyn_plugin import linear_structure_from
from multiphi_exudyn.mechanics.beam import Beam, Clamp, PointMass, Section, planar_beam
from multiphi_exudyn.mechanics.contact import UnilateralContact
from reference_models.beam_system import build_beam_system
from reference_models.full_beam import FullBeam, FullBeamSettings
from reference_models.full_run import EnergyBalance, closed_intervals
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


class TestStaticStart:
    @pytest.mark.parametrize("displacement", [0.02, -0.02])
    @pytest.mark.parametrize("kind", [ANCF, EXACT])
    def test_hits_the_displacement_at_another_point_than_the_load(self, kind, displacement):
        start = START | {"load_at": "node2", "displacement": displacement}
        _, found = run(1e-3, kind=kind, elements=10, start=start)
        assert found.points["node3"][0] == pytest.approx(displacement, rel=1e-8)
        assert (found.gaps["support"][0] < 0) == (displacement < 0)

    @pytest.mark.parametrize("stiffness", [1e5, 1e8])
    def test_downwards_it_rests_on_the_support(self, stiffness):
        contact = replace(SUPPORT, stiffness=stiffness)
        full, found = run(1e-3, contacts=[contact], elements=10, start=START | {"displacement": -0.005})
        structure, h = full.structure, full.structure.row("node2")
        closed = structure.stiffness + stiffness * np.outer(h, h)
        at_rest = np.linalg.solve(closed, -stiffness * contact.gap * h)
        flexibility = structure.row("node3") @ np.linalg.solve(closed, structure.row("node3"))
        force = (-0.005 - structure.row("node3") @ at_rest) / flexibility
        assert found.start_force == pytest.approx(force, rel=5e-3)  # geometric nonlinearity
        assert found.contact_intervals["support"][0][0] == 0.0

    def test_the_work_of_the_force_is_the_initial_energy(self):
        _, found = run(1e-3, damped=False)
        assert found.balance.initial == pytest.approx(found.start_force * 0.02 / 2, rel=2e-3)


class TestFreeFlight:
    @pytest.mark.parametrize("kind", [ANCF, EXACT])
    def test_energy_is_conserved_without_damping(self, kind):
        _, found = run(0.05, kind=kind, elements=10, contacts=(), damped=False, step=1e-4)
        np.testing.assert_allclose(found.energy, found.energy[0], rtol=2e-5)

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

    @pytest.mark.parametrize("kind", [ANCF, EXACT])
    def test_stiffness_damping_leaves_the_shortening_of_a_bent_beam_free(self, kind):
        """At 20 mm geometry is linear to 2e-4; damped axial coordinates would be 12 % off."""
        full = FullBeam(RIG, (), FullBeamSettings(kind=kind, elements=8, step=1e-4))
        s, damping = full.structure, 5e-5 * full.structure.stiffness
        found = full.run(0.1, damping=damping, **START)
        model = mp.MultiPhiModel(mp.LinearStructure(s.mass, s.stiffness, damping, s.points), modes="all")
        unit = model.static_equilibrium({"node3": 1.0})
        linear = mp.simulate(model, 0.1 + 1e-9, displacement=unit * 0.02 / float(s.row("node3") @ unit))
        wanted = linear.at("node3", found.time)
        assert np.linalg.norm(found.points["node3"] - wanted) < 1e-3 * np.linalg.norm(wanted)


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

    def test_force_and_intervals_follow_the_gap(self, impact):
        _, found = impact
        gap, force = found.gaps["support"], found.contact_force["support"]
        np.testing.assert_allclose(gap, found.points["node2"] + 1.35e-3, atol=1e-12)
        np.testing.assert_allclose(force, 1e6 * np.maximum(0, -gap), rtol=1e-12)
        closed = np.zeros(len(gap), dtype=bool)
        for start, end in found.contact_intervals["support"]:
            closed |= (found.time > start) & (found.time < end)
        np.testing.assert_array_equal(closed, gap < 0)
        assert found.contact_intervals["support"][0][0] == pytest.approx(0.069, abs=1e-4)
        assert found.status == "ok"
        assert found.balance.worst_gain < 1e-3

    def test_round_support_agrees_with_the_coordinate_contact_before_chaos(self, impact):
        _, found = impact
        _, round_support = run(0.1, step=2e-5, output_step=2e-5, contact="circle")
        assert round_support.status == "ok"
        assert difference(round_support.points, found.points) < 2e-2
        impulse, expected = (np.sum(r.contact_force["support"]) for r in (round_support, found))
        assert impulse == pytest.approx(expected, rel=3e-2)

    @pytest.fixture(scope="class")
    @staticmethod
    def coarse():
        return run(0.08, elements=6, step=5e-5)[1]

    def test_a_stop_above_is_the_mirror_image(self, coarse):
        above = UnilateralContact("support", {"node2": -1.0}, 1.35e-3, 1e6)
        _, mirrored = run(0.08, elements=6, step=5e-5, contacts=[above], start=START | {"displacement": -0.02})
        np.testing.assert_allclose(mirrored.points["node3"], -coarse.points["node3"], atol=1e-8)
        np.testing.assert_allclose(mirrored.gaps["support"], coarse.gaps["support"], atol=1e-8)

    def test_a_coefficient_scales_gap_and_stiffness(self, coarse):
        doubled = UnilateralContact("support", {"node2": 2.0}, 2.7e-3, 2.5e5)
        _, same = run(0.08, elements=6, step=5e-5, contacts=[doubled])
        np.testing.assert_allclose(same.points["node3"], coarse.points["node3"], atol=1e-8)
        np.testing.assert_allclose(same.gaps["support"], 2 * coarse.gaps["support"], atol=1e-8)

    def test_two_stops_keep_the_beam_between_them(self):
        stops = [SUPPORT, UnilateralContact("ceiling", {"node2": -1.0}, 8e-3, 1e6)]
        _, found = run(0.2, elements=10, step=1e-4, contacts=stops, damped=False)
        assert found.contact_intervals["support"]
        assert found.contact_intervals["ceiling"][0][0] == 0.0  # the start bends the beam around it
        assert min(found.gaps["support"].min(), found.gaps["ceiling"].min()) > -5e-4

    @pytest.mark.parametrize(
        ("kind", "stiffness", "step"),
        [(ANCF, 1e5, 1e-4), (EXACT, 1e5, 1e-4), (EXACT, 1e7, 1e-5), (ANCF, 1e8, 5e-6)],
    )
    def test_every_stiffness_runs_through_its_first_impacts(self, kind, stiffness, step):
        contact = replace(SUPPORT, stiffness=stiffness)
        start = START | {"displacement": 0.02}
        _, found = run(0.09, kind=kind, elements=8, step=step, contacts=[contact], damped=False, start=start)
        assert (found.status, found.message) == ("ok", "")
        assert len(found.contact_intervals["support"]) > 1


class TestFailures:
    def test_a_solver_that_does_not_converge_is_a_status_with_its_time(self):
        _, found = run(0.1, newton_tolerance=1e-15)
        assert found.status == "failed"
        assert "step size" in found.message
        assert f"at {found.failed_at:.6g} s" in found.message
        assert found.failed_at < 0.1
        assert len(found.points["node3"]) == len(found.time)

    def test_an_energy_gain_is_a_failure(self):
        _, found = run(0.1, elements=4, step=1e-4, newton_tolerance=1e-2)
        assert found.status == "failed"
        assert "energy gained" in found.message
        assert found.failed_at == found.balance.gain_at < 0.1

    def test_the_cpu_limit_is_a_failure(self):
        _, found = run(10.0, cpu_limit_s=0.1)
        assert found.status == "failed"
        assert "CPU limit of 0.1 s" in found.message
        assert 0 < found.failed_at < 10
        assert exu.special.solver.timeout == -1

    def test_a_start_that_cannot_be_found_is_a_failure_at_time_zero(self):
        hinged = replace(RIG, clamp=Clamp(rotation=0.0))
        _, found = run(0.1, beam=hinged, contacts=(), damped=False)
        assert (found.status, found.failed_at, found.steps) == ("failed", 0.0, 0)
        assert "static start" in found.message

    def test_ctrl_c_ends_the_run_and_leaves_the_handler(self, monkeypatch):
        handler = signal.getsignal(signal.SIGINT)
        monkeypatch.setattr(Recorder, "keep_state", lambda *_: signal.raise_signal(signal.SIGINT))
        monkeypatch.setattr(Recorder, "close", lambda _: None)
        with pytest.raises(KeyboardInterrupt):
            run(10.0)
        assert signal.getsignal(signal.SIGINT) is handler


def test_nothing_is_written_or_printed(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(exu.config, "printToConsole", True)  # other tests may have switched it off
    run(0.01)
    run(0.01, newton_tolerance=1e-15)
    assert list(tmp_path.iterdir()) == []
    assert capfd.readouterr() == ("", "")
    assert exu.config.printToConsole is True


def test_the_grid_does_not_depend_on_the_step():
    _, found = run(0.01, step=0.87e-4, contacts=(), elements=6)
    np.testing.assert_allclose(found.time, 1e-4 * np.arange(101), atol=1e-12)
    assert found.steps == 115
    assert found.dofs == FullBeam(RIG, (), found.settings).dofs


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

    @pytest.mark.parametrize("interval", [1e-4, 3e-4, 7e-5, 0.1 / 1024])
    @pytest.mark.parametrize("samples", [1, 3, 57])
    @pytest.mark.parametrize("step", [1e-4, 6.51e-5])
    def test_any_end_and_step(self, interval, samples, step):
        expected = interval * np.arange(samples + 1)
        _, found = run(expected[-1], elements=2, contacts=(), step=step, output_step=interval)
        np.testing.assert_array_equal(found.time, expected)

    def test_an_end_between_two_samples(self):
        _, found = run(0.01005, elements=2, contacts=(), step=1e-4)
        np.testing.assert_array_equal(found.time, 1e-4 * np.arange(101))

    def test_a_failed_run_has_none_after_its_last_step(self):
        _, found = run(0.1, elements=6, step=1e-4, newton_tolerance=1e-15)
        assert found.status == "failed"
        assert found.failed_at - 1e-4 < found.time[-1] <= found.failed_at * (1 + 1e-9)

    @pytest.mark.slow  # half a million steps, of which Exudyn's running time sums up to 4e-11 s less than 10 s
    def test_half_a_million_steps(self):
        _, found = run(10.0, elements=2, contacts=(), step=2e-5, newton_tolerance=1e-3, output_step=1e-3)
        np.testing.assert_array_equal(found.time, 1e-3 * np.arange(10001))


def test_a_run_can_be_repeated():
    full, first = run(0.02, elements=6, step=1e-4)
    second = full.run(0.02, damping=modal_damping(full.structure), **START)
    np.testing.assert_array_equal(first.points["node3"], second.points["node3"])


class TestArguments:
    @pytest.mark.parametrize(
        ("contact", "match"),
        [
            (UnilateralContact("c", "node2", 1e-3), "'c' stiffness: got inf"),
            (UnilateralContact("c", "nowhere", 1e-3, 1e6), "'nowhere'"),
            (UnilateralContact("c", {"node2": 1.0, "node3": -0.5}, 1e-3, 1e6), "opposite coefficients"),
            (UnilateralContact("c", np.ones(3), 1e-3, 1e6), "one point"),
        ],
    )
    def test_contacts_a_contact_element_cannot_be(self, contact, match):
        with pytest.raises(MultiPhiValueError, match=match):
            FullBeam(RIG, [contact])

    def test_two_contacts_of_one_name(self):
        with pytest.raises(MultiPhiValueError, match="each name once"):
            FullBeam(RIG, [SUPPORT, SUPPORT])

    @pytest.mark.parametrize(
        "wrong",
        [
            {"kind": "shell"},
            {"contact": "square"},
            {"step": 0.0},
            {"output_step": -1.0},
            {"spectral_radius": 1.5},
            {"cpu_limit_s": 0.0},
            {"kind": EXACT, "contact": "circle"},
        ],
    )
    def test_settings_out_of_range(self, wrong):
        with pytest.raises(MultiPhiValueError, match=f"{list(wrong)[-1]}: got"):
            FullBeamSettings(**wrong)

    @pytest.mark.parametrize(
        "wrong",
        [
            {"t_end": 0.0},
            {"load_at": "x"},
            {"measured_at": "x"},
            {"displacement": 0.0},
            {"damping": np.eye(3)},
        ],
    )
    def test_run_arguments_out_of_range(self, wrong):
        full = FullBeam(RIG, [SUPPORT], FullBeamSettings(elements=4))
        with pytest.raises(MultiPhiValueError, match=f"{next(iter(wrong))}: got"):
            full.run(**{"t_end": 0.1} | START | wrong)


class TestIntervals:
    def test_crossings_are_interpolated(self):
        time, gap = np.arange(6.0), np.array([1.0, -1.0, -1.0, 3.0, -1.0, 1.0])
        np.testing.assert_allclose(closed_intervals(time, gap), [(0.5, 2.25), (3.75, 4.5)])

    def test_closed_at_the_ends(self):
        assert closed_intervals(np.arange(3.0), np.array([-1.0, 1.0, -1.0])) == ((0.0, 0.5), (1.5, 2.0))

    def test_never_closed_and_always_closed(self):
        assert closed_intervals(np.arange(3.0), np.ones(3)) == ()
        assert closed_intervals(np.arange(3.0), -np.ones(3)) == ((0.0, 2.0),)


def test_energy_balance_sees_a_gain_after_a_loss():
    time, energy = np.arange(4.0), np.array([10.0, 6.0, 7.0, 5.0])
    balance = EnergyBalance.of(time, energy, np.zeros(4))
    assert (balance.worst_gain, balance.worst_gain_at, balance.gain_at) == (pytest.approx(0.1), 2.0, 2.0)
    assert EnergyBalance.of(time, energy, np.array([0.0, 4.0, 3.0, 5.0])).gain_at is None

"""Loads, moving supports, viscous contacts and force laws of the full beam, against its own linear equations.

The linear equations M x'' + C x' + K x = f(t) + sum h lambda are integrated by scipy at a tight tolerance; amplitudes
are so small that large displacements do not count. What the full beam adds is its step: errors fall with its square.
"""

from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.linalg
from scipy.integrate import solve_ivp

from multiphi_exudyn import (
    BaseMotion,
    Beam,
    ConstantLoad,
    FunctionLoad,
    Gravity,
    Harmonic,
    HarmonicLoad,
    MultiPhiTypeError,
    MultiPhiValueError,
    PointMass,
    SampledLoad,
    Section,
    Smooth,
    StopMotion,
    SweepLoad,
    UnilateralContact,
)
from reference_models.actions import actions_of
from reference_models.beam_system import build_beam_system
from reference_models.drive import Drive
from reference_models.exudyn_quiet import quiet
from reference_models.full_beam import FullBeam, FullBeamSettings
from reference_models.laid_beam import DEFLECTION

BEAM = Beam(
    [Section.rectangle(0, 0.5, width=0.06, height=4e-3, youngs_modulus=43.5e9, density=2700, poisson_ratio=0.33)],
    points={"inner": 0.25, "tip": 0.5},
    masses=[PointMass(0.5, 0.2, 1e-4)],
)
STEPS = (4e-4, 2e-4)
END = 0.12
HIGHEST = 5e4  # rad/s: of the modes of the linear equations; those above move by less than 1e-6
ANCF, EXACT = "ancf", "geometrically-exact"


@dataclass(frozen=True)
class Cubic:
    """F = k1 q + k3 q^3."""

    at: object = "inner"
    name: str = "cubic"
    k1: float = 300.0
    k3: float = 0.0

    def law(self, q):
        return self.k1 * q + self.k3 * q**3

    def force(self, q):
        raise AssertionError("the full beam takes the law, not its segments")


def damping_of(structure, ratio=0.05):
    omega, phi = modes(structure)
    momenta = structure.mass @ phi
    matrix = (momenta * (2 * ratio * omega)) @ momenta.T
    return (matrix + matrix.T) / 2


def modes(structure):
    inverse, vectors = scipy.linalg.eigh(structure.mass, structure.stiffness)
    omega = 1 / np.sqrt(inverse[::-1])
    return omega, vectors[:, ::-1] * omega


def linear(structure, time, force):
    """Deflections of points (k,) each under force(t, x, v) (n,), in the modes that move them."""
    omega, phi = modes(structure)
    reached = np.max(np.abs(phi.T @ np.array(list(structure.points.values())).T), axis=1) > 1e-9
    reached &= omega < HIGHEST
    omega, phi = omega[reached], phi[:, reached]
    n = len(omega)

    def motion(t, z):
        own = phi.T @ force(t, phi @ z[:n], phi @ z[n:])
        return np.concatenate([z[n:], own - omega**2 * z[:n] - 0.1 * omega * z[n:]])

    found = solve_ivp(
        motion, (0, time[-1]), np.zeros(2 * n), method="DOP853", t_eval=time, rtol=1e-8, atol=1e-11, max_step=1e-3
    )
    return {name: (row @ phi) @ found.y[:n] for name, row in structure.points.items()}


def difference(one, other):
    return max(np.linalg.norm(one[name] - other[name]) / np.linalg.norm(other[name]) for name in ("inner", "tip"))


def run(loads, *, kind=ANCF, step=1e-4, contacts=(), laws=(), damped=True, **start):
    tolerance = 1e-7 if kind == ANCF else 1e-5  # of Newton: above round-off
    settings = FullBeamSettings(kind=kind, elements=2, step=step, output_step=4e-4, newton_tolerance=tolerance)
    full = FullBeam(BEAM, contacts, settings, laws)
    given = loads(full) if callable(loads) else loads
    damping = damping_of(full.structure) if damped else None
    found = full.run(END, loads=given, damping=damping, progress=False, **start)
    assert (found.status, found.message) == ("ok", "")
    return full, found


def errors_of(loads, force, **settings):
    """Differences to the linear equations at every step of STEPS; force(full) gives force(t, x, v)."""
    runs = [run(loads, step=step, **settings) for step in STEPS]
    full, found = runs[0]
    expected = linear(full.structure, found.time, force(full))
    return [difference(found.points, expected) for _, found in runs]


def order(errors):
    return np.log2(errors[0] / errors[1])


TIMES = np.linspace(0.0, 0.2, 21)  # its corners are step ends of all STEPS
COURSES = {
    "constant": (ConstantLoad("tip", 0.05), lambda t: 0.05),
    "harmonic": (HarmonicLoad("tip", 0.05, 20.0, 0.5), lambda t: 0.05 * np.cos(40 * np.pi * t + 0.5)),
    "sampled": (
        SampledLoad("tip", TIMES, 0.05 * np.sin(60 * TIMES)),
        lambda t: np.interp(t, TIMES, 0.05 * np.sin(60 * TIMES)),
    ),
    "function": (
        FunctionLoad("tip", lambda t: 0.05 * np.exp(-(((t - 0.04) / 0.01) ** 2))),
        lambda t: 0.05 * np.exp(-(((t - 0.04) / 0.01) ** 2)),
    ),
    "sweep": (
        SweepLoad("tip", 0.05, 10.0, 60.0, 0.2),
        lambda t: 0.05 * np.cos(2 * np.pi * (10 * t + 125 * t**2)),
    ),
}


class TestPointLoads:
    @pytest.mark.parametrize("name", COURSES)
    def test_a_course_in_time_is_met_with_order_two(self, name):
        load, course = COURSES[name]

        def force(full):
            row = full.structure.row("tip")
            return lambda t, x, v: course(t) * row

        errors = errors_of([load], force)
        assert errors[-1] < 2e-3
        assert order(errors) > 1.8

    def test_the_geometrically_exact_beam_is_driven_the_same_way(self):
        errors = errors_of(
            [COURSES["harmonic"][0]],
            lambda full: lambda t, x, v: COURSES["harmonic"][1](t) * full.structure.row("tip"),
            kind=EXACT,
        )
        assert errors[-1] < 2e-3
        assert order(errors) > 1.8

    def test_loads_add_up_and_act_along_their_rows(self):
        both = run([HarmonicLoad({"tip": 2.0, "inner": -1.0}, 0.05, 20.0), ConstantLoad("tip", 0.05)])[1]
        row = run(
            lambda full: [
                HarmonicLoad(2 * full.structure.row("tip") - full.structure.row("inner"), 0.05, 20.0),
                ConstantLoad(full.structure.row("tip"), 0.05),
            ]
        )[1]
        alone = [
            run([HarmonicLoad("tip", 0.1, 20.0), ConstantLoad("tip", 0.05)]),
            run([HarmonicLoad("inner", -0.05, 20.0)]),
        ]
        np.testing.assert_allclose(both.points["tip"], row.points["tip"], rtol=1e-10, atol=1e-14)
        summed = sum(found.points["tip"] for _, found in alone)
        np.testing.assert_allclose(both.points["tip"], summed, atol=1e-5 * np.max(np.abs(summed)))

    @pytest.mark.parametrize("kind", [ANCF, EXACT])
    def test_the_work_of_loads_is_the_energy_of_the_beam(self, kind):
        _, found = run(lambda full: [HarmonicLoad("tip", 5.0, 20.0), Gravity(full.transverse)], kind=kind, damped=False)
        assert found.balance.work > 1e-2
        assert found.balance.final == pytest.approx(found.balance.work, rel=1e-5)
        assert found.balance.worst_gain < 1e-5

    def test_the_static_start_knows_nothing_of_the_loads(self):
        start = {"load_at": "tip", "measured_at": "tip", "displacement": 0.01}
        _, found = run([ConstantLoad("tip", 5.0)], **start)
        _, without = run((), **start)
        assert found.points["tip"][0] == pytest.approx(0.01, rel=1e-8)
        assert found.start_force == pytest.approx(without.start_force, rel=1e-9)
        assert np.max(np.abs(found.points["tip"] - without.points["tip"])) > 1e-2

    def test_between_whole_steps_the_load_is_that_of_the_time_asked_for(self):
        """As where the solver has halved a step."""
        full = FullBeam(BEAM, [STOP], FullBeamSettings(elements=2))
        loads = [HarmonicLoad("tip", 2.0, 20.0), StopMotion("stop", Harmonic(1e-3, 30.0))]
        actions = actions_of(full.structure, full.contacts, loads, 0.1)
        with quiet():
            system = build_beam_system(full.beams, full.settings, full.contacts, driven=True)
        drive = Drive(system, actions, full.structure.coordinates, 0.1, 10)
        for t in (0.0, 0.03, 0.0337, 0.1):
            assert drive(system.mbs, t)
            force = system.mbs.GetObject(system.driver)["forceVector"]
            assert force[system.coordinate("tip")] == pytest.approx(2 * np.cos(40 * np.pi * t), abs=1e-12)
            assert np.count_nonzero(np.abs(force) > 1e-9) == 1
            offset = system.mbs.GetObjectParameter(system.stops["stop"].item, "offset")
            assert offset == pytest.approx(1e-3 * np.cos(60 * np.pi * t) - STOP.gap, abs=1e-15)


class TestGravityAndBase:
    def test_gravity_bends_the_beam_as_its_weight_does(self):
        full = FullBeam(BEAM, (), FullBeamSettings(elements=20))
        weight = full.structure.mass @ full.transverse
        sag = full.structure.row("tip") @ np.linalg.solve(full.structure.stiffness, 9.81 * weight)
        section = BEAM.sections[0]
        bending, line = section.youngs_modulus * section.second_moment, 9.81 * section.density * section.area
        exact = line * 0.5**4 / (8 * bending) + 0.2 * 9.81 * 0.5**3 / (3 * bending)
        assert sag == pytest.approx(exact, rel=1e-8)

    @pytest.mark.parametrize("kind", [ANCF, EXACT])
    def test_gravity_is_met_with_order_two(self, kind):
        errors = errors_of(
            lambda full: [Gravity(full.transverse, 0.05)],
            lambda full: lambda t, x, v: 0.05 * (full.structure.mass @ full.transverse),
            kind=kind,
        )
        assert errors[-1] < 2e-3
        assert order(errors) > 1.8

    @pytest.mark.parametrize(
        ("course", "acceleration"),
        [
            (Harmonic(5e-5, 20.0, 0.5), lambda t: -5e-5 * (40 * np.pi) ** 2 * np.cos(40 * np.pi * t + 0.5)),
            (Smooth(lambda t: 0.1 * t**3), lambda t: 0.6 * t),
        ],
    )
    def test_the_inertia_of_a_moving_base_is_met_with_order_two(self, course, acceleration):
        errors = errors_of(
            lambda full: [BaseMotion(full.transverse, course)],
            lambda full: lambda t, x, v: -acceleration(t) * (full.structure.mass @ full.transverse),
        )
        assert errors[-1] < 2e-3
        assert order(errors) > 1.8

    def test_inertia_in_the_moving_frame_is_a_clamp_that_moves(self):
        """z = Z (1 - cos w t) at the clamp; x of the free coordinates beside it is relative to it."""
        size, omega = 5e-5, 40 * np.pi
        full, found = run(lambda full: [BaseMotion(full.transverse, Smooth(lambda t: size * (1 - np.cos(omega * t))))],
                          step=1e-4, damped=False)  # fmt: skip
        with quiet():
            system = build_beam_system(full.beams, full.settings)
            mass, stiffness, *_ = system.mbs.ComputeLinearizedSystem()
        deflections = system.first_coordinates + DEFLECTION
        held = deflections[0]
        free = full.structure.coordinates  # zero in all that the clamp holds
        omega_n, phi = modes(full.structure)
        omega_n, phi = omega_n[omega_n < HIGHEST], phi[:, omega_n < HIGHEST]
        n = len(omega_n)
        inertia, spring = phi.T @ free.T @ mass[:, held], phi.T @ free.T @ stiffness[:, held]

        def motion(t, z):
            moved, pushed = size * (1 - np.cos(omega * t)), size * omega**2 * np.cos(omega * t)
            return np.concatenate([z[n:], -inertia * pushed - spring * moved - omega_n**2 * z[:n]])

        y = solve_ivp(
            motion, (0, found.time[-1]), np.zeros(2 * n), method="DOP853", t_eval=found.time, rtol=1e-10, atol=1e-13
        ).y[:n]
        base = size * (1 - np.cos(omega * found.time))
        absolute = {name: row @ phi @ y - base for name, row in full.structure.points.items()}
        assert difference(found.points, absolute) < 2e-3


STOP = UnilateralContact("stop", "inner", 2e-5, 3e4)


def contact_force(full, contact, way):
    """h lambda of a stop that moves by way(t) = (z, z')."""
    row, d = full.structure.row("inner"), contact.damping

    def force(t, x, v):
        z, rate = way(t)
        gap = row @ x + contact.gap - z
        pushing = -contact.stiffness * gap - d * (row @ v - rate)
        return row * max(0.0, pushing) if gap < 0 else 0 * row

    return force


class TestStops:
    @pytest.mark.parametrize("above", [False, True])
    def test_a_moving_stop_is_met_with_order_two_and_drives_the_beam(self, above):
        side = {"inner": -1.0} if above else "inner"
        loads = [StopMotion("stop", Smooth(lambda t: 1e-4 * np.sin(60 * t) ** 2))]
        contact = replace(STOP, direction=side)

        def force(full):
            own = contact_force(full, STOP, lambda t: (1e-4 * np.sin(60 * t) ** 2, 0.0))
            return own if not above else lambda t, x, v: -own(t, -x, -v)

        errors = errors_of(loads, force, contacts=[contact])
        assert errors[-1] < 3e-3
        assert order(errors) > 1.4  # events fall between steps

    def test_the_work_of_a_moving_stop_is_the_energy_of_beam_and_stop(self):
        loads = [StopMotion("stop", Smooth(lambda t: 1e-3 * np.sin(60 * t) ** 2))]
        _, found = run(loads, contacts=[STOP], damped=False, step=2e-5)
        assert found.balance.work > 1e-4
        assert found.balance.final == pytest.approx(found.balance.work, rel=5e-3)

    def test_a_stop_left_behind_by_the_base_is_a_stop_that_moves_the_other_way(self):
        base = Smooth(lambda t: 1e-4 * np.sin(60 * t) ** 2)
        full, left = run(lambda f: [BaseMotion(f.transverse, base, ("stop",))], contacts=[STOP])
        share = float(full.structure.row("inner") @ full.transverse)
        away = Smooth(lambda t: -share * 1e-4 * np.sin(60 * t) ** 2)
        _, moved = run(lambda f: [BaseMotion(f.transverse, base), StopMotion("stop", away)], contacts=[STOP])
        np.testing.assert_allclose(left.points["tip"], moved.points["tip"], atol=1e-12)
        np.testing.assert_allclose(left.gaps["stop"], moved.gaps["stop"], atol=1e-12)
        _, carried = run(lambda f: [BaseMotion(f.transverse, base)], contacts=[STOP])
        assert np.max(np.abs(left.points["tip"] - carried.points["tip"])) > 1e-6

    def test_a_viscous_contact_is_met_and_never_pulls(self):
        contact = UnilateralContact("stop", "inner", 1e-4, 3e4, damping=40.0)
        load = HarmonicLoad("tip", -5.0, 20.0, 0.5)

        def force(full):
            own, row = contact_force(full, contact, lambda t: (0.0, 0.0)), full.structure.row("tip")
            return lambda t, x, v: own(t, x, v) - 100 * COURSES["harmonic"][1](t) * row

        errors = errors_of([load], force, contacts=[contact])
        assert errors[-1] < 3e-3
        assert order(errors) > 0.8  # its force jumps where it closes
        _, found = run([load], contacts=[contact])
        assert np.min(found.contact_force["stop"]) == 0.0 < np.max(found.contact_force["stop"])
        _, elastic = run([load], contacts=[replace(STOP, gap=1e-4)])
        assert difference(found.points, elastic.points) > 1e-2

    def test_a_viscous_contact_dissipates_what_the_beam_loses(self):
        contact = UnilateralContact("stop", {"inner": 2.0}, 2e-4, 1e4, damping=10.0)
        load = [HarmonicLoad("tip", 1.0, 20.0), StopMotion("stop", Harmonic(1e-4, 10.0, -np.pi / 2))]
        _, found = run(load, contacts=[contact], damped=False, step=2e-5)
        assert found.balance.dissipated > 0.05 * found.balance.work
        assert found.balance.final + found.balance.dissipated == pytest.approx(found.balance.work, rel=1e-3)

    def test_a_spring_of_a_user_function_is_the_contact_element(self):
        """At hardly any damping the two implementations of a contact agree."""
        load = [HarmonicLoad("tip", -5.0, 20.0)]
        _, element = run(load, contacts=[replace(STOP, gap=5e-4)])
        _, spring = run(load, contacts=[UnilateralContact("stop", "inner", 5e-4, 3e4, damping=1e-9)])
        assert element.contact_intervals["stop"]
        assert difference(spring.points, element.points) < 1e-3


class TestForceLaws:
    def test_a_linear_law_is_a_spring_at_its_point(self):
        law = Cubic()

        def force(full):
            row, at = full.structure.row("tip"), full.structure.row("inner")
            return lambda t, x, v: COURSES["harmonic"][1](t) * row - at * 300.0 * (at @ x)

        errors = errors_of([COURSES["harmonic"][0]], force, laws=[law])
        assert errors[-1] < 2e-3
        assert order(errors) > 1.8

    def test_a_cubic_law_is_met_with_order_two(self):
        law = Cubic({"inner": -2.0}, k3=2e11)

        def force(full):
            row, at = full.structure.row("tip"), -2 * full.structure.row("inner")
            return lambda t, x, v: COURSES["harmonic"][1](t) * row - at * law.law(at @ x)

        errors = errors_of([COURSES["harmonic"][0]], force, laws=[law])
        assert errors[-1] < 2e-3
        assert order(errors) > 1.8

    def test_the_energy_of_a_law_is_counted_from_its_start_on(self):
        start = {"load_at": "tip", "measured_at": "tip", "displacement": 0.01}
        _, found = run((), laws=[Cubic(k3=1e8)], damped=False, step=5e-5, **start)
        _, soft = run((), damped=False, **start)
        assert found.balance.initial > 1.1 * soft.balance.initial
        assert found.balance.final == pytest.approx(found.balance.initial, rel=1e-3)
        np.testing.assert_allclose(found.energy, found.energy[0], rtol=1e-3)


class TestArguments:
    @pytest.mark.parametrize(
        ("loads", "begins"),
        [
            ([ConstantLoad("nowhere", 1.0)], "point: got 'nowhere'"),
            ([StopMotion("floor", Harmonic(1e-3, 1.0))], "stop motion contact: got 'floor', need one of: stop"),
            ([BaseMotion("tip", Harmonic(1e-3, 1.0), ("floor",))], "fixed_stops: got 'floor'"),
        ],
    )
    def test_loads_that_have_no_place(self, refused, loads, begins):
        full = FullBeam(BEAM, [STOP], FullBeamSettings(elements=2))
        refused(MultiPhiValueError, begins, full.run, 0.1, loads=loads, progress=False)

    def test_a_load_that_is_none(self, refused):
        full = FullBeam(BEAM, (), FullBeamSettings(elements=2))
        refused(MultiPhiTypeError, "loads: got float", full.run, 0.1, loads=[1.0], progress=False)

    def test_a_law_that_has_no_place(self, refused):
        refused(MultiPhiValueError, "force law 'cubic' at: got 'x'", FullBeam, BEAM, (), force_laws=[Cubic("x")])

    def test_a_round_support_neither_moves_nor_damps(self, refused):
        settings = FullBeamSettings(elements=2, contact="circle")
        viscous = UnilateralContact("stop", "inner", 1e-3, 1e4, damping=1.0)
        refused(MultiPhiValueError, "contact 'stop': got a circle", FullBeam, BEAM, [viscous], settings)
        full = FullBeam(BEAM, [STOP], settings)
        loads = [StopMotion("stop", Harmonic(1e-3, 1.0))]
        refused(MultiPhiValueError, "contact 'stop': got a circle", full.run, 0.1, loads=loads, progress=False)

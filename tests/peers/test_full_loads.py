"""Loads, moving supports, viscous contacts and force laws of the full beam, against its own linear equations.

The linear equations M x'' + C x' + K x = f(t) + sum h lambda are integrated by scipy at a tight tolerance; amplitudes
are so small that large displacements do not count. What the full beam adds is its step: errors fall with its square.
"""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from scipy.integrate import solve_ivp

from multiphi_exudyn import (
    BaseMotion,
    Beam,
    ConstantLoad,
    FunctionLoad,
    Harmonic,
    HarmonicLoad,
    MultiPhiValueError,
    PointMass,
    SampledLoad,
    Section,
    Smooth,
    StopMotion,
    SweepLoad,
    UnilateralContact,
)
from reference_models.full_beam import FullBeam, FullBeamSettings

BEAM = Beam(
    [Section.rectangle(0, 0.5, width=0.06, height=4e-3, youngs_modulus=43.5e9, density=2700, poisson_ratio=0.33)],
    points={"inner": 0.25, "tip": 0.5},
    masses=[PointMass(0.5, 0.2, 1e-4)],
)
STEPS = (4e-4, 2e-4)
END = 0.12
HIGHEST = 5e4  # rad/s: of the modes of the linear equations; those above move by less than 1e-6
ANCF, EXACT = "ancf", "geometrically-exact"


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


class TestGravityAndBase:
    def test_gravity_bends_the_beam_as_its_weight_does(self):
        full = FullBeam(BEAM, (), FullBeamSettings(elements=20))
        weight = full.structure.mass @ full.transverse
        sag = full.structure.row("tip") @ np.linalg.solve(full.structure.stiffness, 9.81 * weight)
        section = BEAM.sections[0]
        bending, line = section.youngs_modulus * section.second_moment, 9.81 * section.density * section.area
        exact = line * 0.5**4 / (8 * bending) + 0.2 * 9.81 * 0.5**3 / (3 * bending)
        assert sag == pytest.approx(exact, rel=1e-8)


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

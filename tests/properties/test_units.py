"""Other units of time, length and mass change no status, no event and no number but by round-off."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from campaign_scenes.plain import built, recipe_of
from numpy.testing import assert_allclose
from units import Units, in_units

import multiphi_exudyn as mp

POWERS = (
    -40,
    18,
)  # of two, even: every number and its square root is scaled exactly, so that round-off is the same too
QUANTITIES = ("time", "length", "mass")
SAME = 1e-9  # of a run's length and of its energy
SHORTER = 0.25  # of a case's length: enough for a few events
PARTS = ("initial", "work_of_loads", "impact", "truncation_kinetic", "truncation_strain", "damping", "final")


@dataclass(frozen=True)
class Given:
    """Arguments of ``simulate``; contacts: as given to the model."""

    model: mp.MultiPhiModel
    contacts: list
    t_end: float
    displacement: np.ndarray
    velocity: np.ndarray
    loads: list


def drawn(number, kind):
    """A random case: structure, damping, start and loads of a recipe, and what ``kind`` adds."""
    random, case = np.random.default_rng([number, 7]), built(recipe_of(number))
    contacts, loads, at = list(case.model.contacts), list(case.loads), f"m{random.integers(case.model.structure.n)}"
    if kind == "viscous":
        contacts = [c if c.rigid else replace(c, damping=0.05 * math.sqrt(c.stiffness)) for c in contacts]
    elif kind == "law":
        table = [-1.0, -0.02, 0.0, 0.03, 1.0], random.uniform(0.1, 10) * np.array([-300.0, -1.0, 0.0, 2.0, 400.0])
        contacts.append(mp.ForceLaw(at, table))
    elif kind == "harmonic":
        loads.append(mp.HarmonicLoad(at, random.uniform(1, 5), random.uniform(0.15, 9) / case.t_end))
    elif kind == "stop":
        course = mp.Harmonic(random.uniform(0.001, 0.05), random.uniform(0.5, 4) / case.t_end, -math.pi / 2)
        loads.append(mp.StopMotion(contacts[0].name, course))
    modes = "all" if kind == "law" else case.model.modes
    model = mp.MultiPhiModel(case.model.structure, contacts, modes=modes)
    return Given(model, contacts, SHORTER * case.t_end, case.displacement, case.velocity, loads)


def run(given, units):
    """Status and trajectory, None where the case is refused."""
    try:
        trajectory = mp.simulate(**in_units(given, units))
    except mp.MultiPhiError as error:
        return type(error).__name__, None
    return trajectory.status, trajectory


def events(trajectory, units):
    return [] if trajectory is None else [(e.contact, e.kind, e.time / units.time) for e in trajectory.events]


def differences(given, units, one):
    """What differs from the run ``one``, in words."""
    other = run(given, units)
    if one[0] != other[0]:
        return f"status {one[0]}, {other[0]}"
    before, after = events(one[1], Units()), events(other[1], units)
    if [e[:2] for e in before] != [e[:2] for e in after]:
        return f"{len(before)} events, {len(after)}, not the same"
    late = max((abs(a[2] - b[2]) for a, b in zip(before, after, strict=True)), default=0.0)
    if late > SAME * given.t_end:
        return f"an event {late:g} s later"
    if one[1] is None or not one[1].segments:
        return ""
    energies = [np.array([getattr(run.ledger, part) for part in PARTS]) for run in (one[1], other[1])]
    off = np.max(np.abs(energies[1] / units.energy - energies[0]))
    return "" if off <= SAME * np.max(np.abs(energies[0])) else f"energies {energies}"


@pytest.mark.parametrize("kind", ["plain", "viscous", "law", "harmonic", "stop"])
@pytest.mark.parametrize("number", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in range(1, 60))])
def test_change_nothing_that_happens(number, kind):
    given = drawn(number, kind)
    one = run(given, Units())
    for quantity in QUANTITIES:
        for power in POWERS:
            assert not differences(given, Units(**{quantity: 2.0**power}), one), f"{quantity} by 2^{power}"


@pytest.mark.parametrize("power", range(-20, 21, 5))
def test_a_stop_that_is_touched_without_speed_is_not_struck(power):
    """The point before it stands, the other one leaves: what is left of the first one's speed is round-off.

    Of the two free modes only one moves the first point.
    """
    for seed in range(20):
        random = np.random.default_rng(seed)
        root = random.normal(size=(2, 2))
        mass = (root @ root.T + np.eye(2)) * 2.0**power
        structure = mp.LinearStructure(mass, np.zeros((2, 2)), points={"a": 0, "b": 1})
        contacts = [mp.UnilateralContact(name, {name: -1.0}, 0.0) for name in "ab"]
        model = mp.MultiPhiModel(structure, contacts, modes="all")
        run = mp.simulate(model, 1e-3, velocity=np.array([0.0, -2.0]))
        assert not [event for event in run.events if event.time == 0.0 and event.impulse != 0.0], (seed, run.events)


class TestFreeBodiesWithADashpot:
    @pytest.mark.parametrize("unit", [2.0**k for k in (-40, -20, 0, 20, 40)])
    def test_come_to_move_together(self, unit):
        """Two free masses: the velocity of one relative to the other decays with c (1/m_1 + 1/m_2)."""
        mass, resistance = np.diag([2.0, 3.0]), 5.0 / unit
        damping = resistance * np.array([[1.0, -1.0], [-1.0, 1.0]])
        structure = mp.LinearStructure(mass, np.zeros((2, 2)), damping, {"a": 0, "b": 1})
        contacts = [mp.UnilateralContact("far", "a", 1e6)]
        run = mp.simulate(
            mp.MultiPhiModel(structure, contacts, modes="all"), unit, velocity=np.array([1.0, 0.0]) / unit
        )
        t = np.linspace(0, 1, 7)
        rate = 5.0 * (1 / 2 + 1 / 3)
        apart = (1 - np.exp(-rate * t)) / rate
        assert_allclose(run.at("a", t * unit), 0.4 * t + 0.6 * apart, rtol=0, atol=1e-15)
        assert_allclose(run.at("b", t * unit), 0.4 * t - 0.4 * apart, rtol=0, atol=1e-15)


class TestLoadsNearResonance:
    """The response to a load near a pole is a polynomial of many powers of time on the load's carrier."""

    @staticmethod
    def run(unit, damping):
        stiffness = np.array([[30.0, -10.0], [-10.0, 10.0]])
        structure = mp.LinearStructure(
            np.eye(2), stiffness / unit**2, None if damping is None else damping / unit, {"a": 0, "b": 1}
        )
        model = mp.MultiPhiModel(structure, [mp.UnilateralContact("stop", "b", 0.01, 500.0 / unit**2)], modes="all")
        frequency = (model.level(()).omega[0] / (2 * math.pi)) * (1 + 2e-2)
        loads = [
            mp.HarmonicLoad("a", 1 / unit**2, frequency),
            mp.FunctionLoad("b", lambda t: np.exp(-t / unit) / unit**2, tolerance=1e-9),
        ]
        return mp.simulate(model, 4.0 * unit, loads=loads)

    @pytest.mark.parametrize("damping", [None, np.array([[0.1, -0.05], [-0.05, 0.3]])], ids=["undamped", "coupled"])
    @pytest.mark.parametrize("unit", [2.0**-40, 2.0**40])
    def test_move_alike_in_every_unit_of_time(self, unit, damping):
        one, other, t = self.run(1.0, damping), self.run(unit, damping), np.linspace(0, 4, 41)
        assert (one.status, one.message) == (other.status, other.message) == ("ok", "")
        assert len(one.events) > 2
        assert [(e.kind, e.time * unit) for e in one.events] == [(e.kind, e.time) for e in other.events]
        assert np.array_equal(one.displacement(t), other.displacement(t * unit))
        assert np.array_equal(one.velocity(t), other.velocity(t * unit) * unit)
        assert np.array_equal(one.contact_force("stop", t), other.contact_force("stop", t * unit) * unit**2)
        assert one.ledger.work_of_loads == other.ledger.work_of_loads * unit**2
        assert one.ledger.damping == other.ledger.damping * unit**2

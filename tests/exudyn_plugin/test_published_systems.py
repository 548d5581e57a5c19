"""Exudyn's own published systems with contacts and stops: what reduce finds in them, and its motion beside theirs."""

from dataclasses import dataclass

import numpy as np
import pytest

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import reduce
from reference_models import published_systems as published
from reference_models.published_systems import OwnRun

pytestmark = pytest.mark.usefixtures("quiet_exudyn")


@dataclass
class Both:
    """A published system's reduction, its trajectory, and Exudyn's own run."""

    reduction: object
    trajectory: object
    own: OwnRun
    point: str

    @property
    def error(self):
        """Largest distance at the point, of its largest displacement."""
        times = np.minimum(self.own.time, self.trajectory.t_end)
        own = self.own_at(self.reduction.structure.row(self.point))
        return np.max(np.abs(self.trajectory.at(self.point, times) - own)) / np.max(np.abs(own))

    def own_at(self, row):
        return self.own.of_row(self.reduction.structure.coordinates @ row)

    def own_intervals(self, name):
        (contact,) = (c for c in self.reduction.model.contacts if c.name == name)
        return self.own.negative(self.own_at(self.reduction.structure.row(contact.direction)) + contact.gap)


def both(build, **options):
    system = build()
    reduction = reduce(system.mbs, **options)
    trajectory = mp.simulate(reduction.model, system.end, velocity=reduction.velocity, loads=reduction.loads)
    assert trajectory.status == "ok"
    return Both(reduction, trajectory, OwnRun.of(system), system.point)


def names_left_out(reduction):
    return [item.name for item, _ in reduction.left_out]


def rebound(mass, stiffness, damping, pulls):
    """Speed after a damped stop of the speed before, duration [s] until the gap is zero; without a load.

    From penetration x = v/w sin(w t) exp(-z w0 t): a stop that pulls lets go at x = 0, one that does not at
    k x + c x' = 0, and the rest of x is flown free.
    """
    own = np.sqrt(stiffness / mass)
    ratio = damping / (2 * mass * own)
    damped = own * np.sqrt(1 - ratio**2)
    time = (np.pi if pulls else np.pi - 2 * np.arcsin(ratio)) / damped
    factor = np.exp(-ratio * own * time)
    depth = np.sin(damped * time) / damped * factor
    return factor, time + depth / factor


def position_between_stops(end, pulls, limit=0.95, speed=10.0):
    """A mass of 0.5 kg between damped stops of 1e4 N/m and 10 N s/m, in free flight at the end."""
    factor, duration = rebound(0.5, 1e4, 10.0, pulls)
    time, way = limit / speed, -1.0
    while time + duration + 2 * limit / (factor * speed) < end:
        time, speed, way = time + duration + 2 * limit / (factor * speed), factor * speed, -way
    return way * (-limit + factor * speed * (end - time - duration))


def test_damped_limit_stops_are_exact_and_differ_from_exudyn_by_the_pull_of_its_law_alone():
    found = both(published.friction_stops_and_gears)
    ours = found.trajectory.at("stopped position", 2.0)
    theirs = found.own_at(found.reduction.structure.row("stopped position"))[-1]
    assert ours == pytest.approx(position_between_stops(2.0, pulls=False), abs=1e-9)
    assert theirs == pytest.approx(
        position_between_stops(2.0, pulls=True), abs=4e-3
    )  # five impacts of 1 ms by steps of 0.02 ms
    assert abs(ours - theirs) > 0.2


def test_friction_is_left_out_by_name_and_a_driven_gear_is_taken():
    reduction = reduce(published.friction_stops_and_gears().mbs)
    assert names_left_out(reduction) == ["regularised", "bristle"]
    (drive,) = (item for item in reduction.taken if item.name == "drive")
    assert drive.became.endswith("; the motion that it prescribes")
    assert [c.name for c in reduction.model.contacts] == ["stopped.upper", "stopped.lower"]


def test_the_bouncing_ball_rebounds_by_the_law_without_pull_and_exudyn_by_the_one_with():
    found = both(published.bouncing_ball)
    speed, weight = np.sqrt(2 * 9.81 * 0.05), 0.25 * 9.81
    assert names_left_out(found.reduction) == []
    for pulls, intervals in (
        (False, found.trajectory.contact_intervals("floor")),
        (True, found.own_intervals("floor")),
    ):
        factor, duration = rebound(0.25, 2e6, 200.0, pulls)
        (close, _), (again, _) = intervals
        assert close == pytest.approx(speed / 9.81, abs=2e-6)
        assert again - close - duration == pytest.approx(2 * factor * speed / 9.81, rel=weight / (200.0 * speed))


def test_a_mass_on_a_stop_comes_to_rest_where_exudyn_has_it():
    found = both(published.mass_on_a_stop)
    assert found.trajectory.at("height", 1.0) == pytest.approx(-0.1 - 10.0 / 1e4, abs=1e-9)
    assert found.own_at(found.reduction.structure.row("height"))[-1] == pytest.approx(-0.101, abs=1e-9)
    assert found.error < 0.04  # the law without pull flies a little higher after the first impact


def test_a_stop_hidden_in_a_user_function_is_told():
    reduction = reduce(published.bouncing_ball_by_user_function().mbs)
    ((item, reason),) = reduction.left_out
    assert (item.name, reason) == ("floor", "the difference of its user function from its tangent at the current state")
    assert reduction.model.contacts == ()


def test_contacts_with_circles_are_each_left_out():
    reduction = reduce(published.cable_on_circles().mbs)
    assert {item.type for item, _ in reduction.left_out} == {"ObjectContactCircleCable2D"}
    assert len(reduction.left_out) == 16


def test_a_cable_on_eight_stops_moves_as_in_exudyn_and_more_modes_come_closer():
    few, every = (both(published.cable_on_nodal_stops, modes=modes) for modes in (12, "all"))
    assert names_left_out(every.reduction) == ["stop at y0"]
    assert every.error < 0.005
    assert few.error > 10 * every.error
    touched = [c.name for c in every.reduction.model.contacts if every.own_intervals(c.name)]
    assert len(touched) >= 3
    for name in touched:
        first = every.trajectory.contact_intervals(name)[0]
        assert first == pytest.approx(every.own_intervals(name)[0], abs=2e-4)

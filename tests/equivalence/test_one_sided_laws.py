"""Force laws whose centre is an end of their table or span: beyond both ends the last lines go on."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from small_structures import chain
from true_law import force_of_links

import multiphi_exudyn as mp

TIMES = np.linspace(0, 6, 61)
ROW = np.array([0.0, -0.5, 1.0])
AT = {"m2": 1.0, "m1": -0.5}


def lines(table):
    """Every line of a table as its force at q = 0 and its slope, and the bends between them."""
    knots, forces = map(np.asarray, table)
    slopes = np.diff(forces) / np.diff(knots)
    return forces[:-1] - slopes * knots[:-1], slopes, knots[1:-1]


def crossing(edge, direction):
    def event(_t, y):
        return ROW @ y[:3] - edge

    event.terminal, event.direction = True, direction
    return event


def followed(structure, table, velocity):
    """x (3, k) at TIMES of M x'' + C x' + K x = -p F(p.x) from x = 0, from bend to bend of the table, to 1e-12."""
    constants, slopes, bends = lines(table)
    edges = np.concatenate([[-np.inf], bends, [np.inf]])
    t, y, values = 0.0, np.concatenate([np.zeros(3), velocity]), np.zeros((3, len(TIMES)))
    place = int(np.searchsorted(bends, 1e-13 * (ROW @ velocity)))
    while t < TIMES[-1]:

        def rate(_t, y, constant=constants[place], slope=slopes[place]):
            force = -ROW * (constant + slope * (ROW @ y[:3])) - structure.stiffness @ y[:3] - structure.damping @ y[3:]
            return np.concatenate([y[3:], np.linalg.solve(structure.mass, force)])

        exits = [(edges[place], -1), (edges[place + 1], 1)]
        given = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-13, "max_step": 0.1, "dense_output": True}
        found = solve_ivp(rate, (t, TIMES[-1]), y, events=[crossing(*each) for each in exits], **given)
        here = (t <= TIMES) & (found.t[-1] >= TIMES)
        if np.any(here):
            values[:, here] = found.sol(TIMES[here])[:3]
        t, y = float(found.t[-1]), found.y[:, -1]
        place += len(found.t_events[1]) - len(found.t_events[0])
    return values


def structure():
    return chain(3, damping=np.diag([0.02, 0.0, 0.03]), stiffness=4.0)


def tables():
    """Tables of every kind, by name: centre at either end, no zero, one-sided, decreasing, flat at an end."""
    random = np.random.default_rng(5)

    def rising(count):
        return np.cumsum(random.uniform(0.1, 4.0, count))

    q = {count: np.append(0.0, np.cumsum(random.uniform(0.05, 0.4, count))) for count in (1, 2, 3, 5)}
    return {
        "from zero up": (q[3], np.append(0.0, rising(3))),
        "up to zero": (-q[3][::-1], -np.append(0.0, rising(3))[::-1]),
        "one line": (q[1], np.append(0.0, rising(1))),
        "one line, shifted": (0.3 + q[1], np.append(0.0, rising(1))),
        "all positive": (q[2] - 0.1, 1.0 + np.append(0.0, rising(2))),
        "all positive, to the right": (0.2 + q[5], 0.5 + np.append(0.0, rising(5))),
        "all negative, to the left": (-0.2 - q[5][::-1], -0.5 - np.append(0.0, rising(5))[::-1]),
        "decreasing": (q[2], -0.2 * np.append(0.0, rising(2))),
        "decreasing, all positive": (0.1 + q[2], 2.0 - 0.2 * np.append(0.0, rising(2))),
        "flat at its upper end": (q[3], np.append(0.0, [1.0, 1.5, 1.5])),
        "flat at its lower end": (q[3], np.append([0.0, 0.0], [1.0, 1.8])),
        "flat at both ends": (q[3] - 0.2, np.array([1.0, 1.0, 2.0, 2.0])),
        "zero at the last knot": (0.1 + q[2], np.array([-2.0, -0.5, 0.0])),
        "not monotonic": (q[5], np.array([0.0, 1.0, 0.4, 1.2, 0.9, 2.0])),
    }


@pytest.mark.parametrize("name", tables())
class TestEveryTable:
    def test_its_links_are_its_force_on_both_sides_of_both_ends(self, name):
        knots, forces = tables()[name]
        law = mp.ForceLaw(AT, (knots, forces))
        q = np.linspace(knots[0] - 2, knots[-1] + 2, 401)
        constants, slopes, bends = lines((knots, forces))
        place = np.searchsorted(bends, q)
        expected = constants[place] + slopes[place] * q
        assert_allclose(law.force(q), expected, rtol=0, atol=1e-13 * np.max(np.abs(expected)))
        assert_allclose(force_of_links(law, q), expected, rtol=0, atol=1e-12 * np.max(np.abs(expected)))

    def test_the_motion_is_that_of_the_law_and_keeps_its_ledger(self, name):
        table, own = tables()[name], structure()
        velocity = np.array([0.0, -1.5, 2.0])
        run = mp.simulate(mp.MultiPhiModel(own, [mp.ForceLaw(AT, table)], modes="all"), 6.0, velocity=velocity)
        expected = followed(own, table, velocity)
        assert run.status == "ok"
        assert np.ptp(ROW @ expected) > 0.5
        assert np.max(np.abs(run.displacement(TIMES) - expected)) < 1e-9 * np.max(np.abs(expected))
        assert abs(run.ledger.residual) < 1e-10 * run.ledger.initial


@pytest.mark.parametrize(("function", "span"), [
    (lambda q: 100 * q, (0.0, 1.0)),
    (lambda q: 100 * q, (-1.0, 0.0)),
    (lambda q: q + 2 * q**3, (0.5, 1.5)),
    (lambda q: -1 / (3 - q) ** 2, (-1.0, -0.25)),
    (lambda q: 3 - q, (0.0, 1.0)),
])  # fmt: skip
def test_a_function_followed_on_one_side_goes_on_in_a_line_on_the_other(function, span):
    law = mp.ForceLaw(AT, function, span=span, segments=12)
    own, velocity = structure(), np.array([0.0, -1.5, 2.0])
    run = mp.simulate(mp.MultiPhiModel(own, [law], modes="all"), 6.0, velocity=velocity)
    expected = followed(own, (law.knots, law.forces), velocity)
    assert run.status == "ok"
    assert np.max(np.abs(run.displacement(TIMES) - expected)) < 1e-9 * np.max(np.abs(expected))

"""The shortest change that contacts allow: admissible, by pushing alone, without energy from nowhere, or a failure."""

import numpy as np
import pytest
import scipy.optimize
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.mathematics.least_distance import least_distance
from multiphi_exudyn.mathematics.round_off import FOLLOWING, ZERO

KINDS = ("random", "twice", "opposite", "dependent", "nearly")
HARD = range(7, 11)  # digits of an angle between rows beside which the tolerances of what follows from what are large
AMPLIFIED = 1e-12  # of the terms of a complementarity, over the angle between rows


def directions(random, kind, k, r, angle):
    """Rows (k, r): some of them the same, opposite, combinations of others, or off by an angle from another."""
    rows = random.normal(size=(k, r))
    for i in range(1, k):
        if kind != "random" and random.random() < 0.6:
            other = rows[int(random.integers(i))]
            size = 10.0 ** random.uniform(-2, 2)
            rows[i] = {
                "twice": size * other,
                "opposite": -size * other,
                "dependent": random.normal(size=i) @ rows[:i],
                "nearly": random.choice([-1.0, 1.0]) * other + angle * random.normal(size=r),
            }[kind]
    return rows


def nearest_admissible(rows, vector, free=None):
    """(v+, p): Moreau's impact, v+ with rows v+ >= 0 nearest to ``vector``; only its first components change."""
    free = len(vector) if free is None else free
    change, multipliers = least_distance(rows[:, :free].copy(), -(rows @ vector), np.abs(rows) @ np.abs(vector))
    return vector + np.pad(change, (0, len(vector) - free)), multipliers


def solved(rows, vector, free):
    """(v+, p), None where there is none."""
    try:
        return nearest_admissible(rows, vector, free)
    except NumericalFailure:
        return None


@settings(derandomize=True, max_examples=75, deadline=None)
@given(
    st.integers(0, 2**31),
    st.sampled_from(KINDS),
    st.integers(1, 7),
    st.integers(1, 6),
    st.integers(0, 2),
    st.integers(3, 13),
    st.sampled_from([-40, 0, 40]),
)
def test_an_impact_is_admissible_pushes_and_gains_no_energy(seed, kind, k, r, moving, digits, power):
    random, scale, angle = np.random.default_rng(seed), 2.0**power, 10.0**-digits
    rows = np.hstack([directions(random, kind, k, r, angle), random.normal(size=(k, moving))])
    vector = random.normal(size=r + moving) * random.choice([1.0, 1e-7], r + moving)
    found, scaled = solved(rows, vector, r), solved(scale * rows, vector / scale, r)
    if found is None:
        assert scaled is None
        assert moving or (kind == "nearly" and digits in HARD)
        return
    after, impulses = found
    assert scaled is not None
    assert np.array_equal(scaled[0] * scale, after)
    assert np.array_equal(scaled[1] * scale**2, impulses)
    change = after[:r] - vector[:r]
    lengths = np.linalg.norm(rows[:, :r], axis=1)
    terms = np.abs(rows) @ np.abs(vector) + lengths * np.linalg.norm(change)
    slack = FOLLOWING if kind == "nearly" else 2 * ZERO
    assert np.all(rows @ after >= -slack * terms)
    assert np.all(impulses >= 0)
    assert np.array_equal(after[r:], vector[r:])
    closeness = 1e-10 if kind == "nearly" else 1e-4  # of the rows that push, random ones at the least
    assert np.all(np.abs(rows @ after)[impulses > 0] <= AMPLIFIED / closeness * terms[impulses > 0])
    assert_allclose(impulses @ rows[:, :r], change, rtol=0, atol=1e-14 * float(impulses @ lengths) + 1e-300)
    if not moving:
        assert np.linalg.norm(after) <= (1 + 1e-13) * np.linalg.norm(vector)


@settings(derandomize=True, max_examples=40, deadline=None)
@given(st.integers(0, 2**31), st.sampled_from(KINDS[:-1]), st.integers(1, 5), st.integers(1, 3))
def test_fails_where_stops_exclude_each_other_and_only_there(seed, kind, k, r):
    """Whether there is an admissible velocity is judged by linear programming."""
    random = np.random.default_rng(seed)
    rows = np.column_stack([directions(random, kind, k, r, 0.0), random.normal(size=k)])
    found = solved(rows, np.append(random.normal(size=r), 1.0), r)
    feasible = scipy.optimize.linprog(np.zeros(r), -rows[:, :r], rows[:, r], bounds=(None, None)).status == 0
    assert (found is not None) == feasible


@settings(derandomize=True, max_examples=40, deadline=None)
@given(st.integers(0, 2**31), st.sampled_from(KINDS[:-1]), st.integers(1, 5), st.integers(1, 5))
def test_is_the_shortest(seed, kind, k, r):
    random = np.random.default_rng(seed)
    rows = directions(random, kind, k, r, 0.0)
    least = rows @ random.normal(size=r)
    x, _ = least_distance(rows, least, np.abs(least))
    brute = scipy.optimize.minimize(
        lambda x: x @ x,
        x + 0.1 * random.normal(size=r),
        jac=lambda x: 2 * x,
        method="SLSQP",
        constraints={"type": "ineq", "fun": lambda x: rows @ x - least, "jac": lambda x: rows},
        options={"ftol": 1e-14},
    )
    if brute.success:
        assert x @ x <= brute.fun + 1e-7 * (1 + brute.fun)


@pytest.mark.parametrize("nudge", [-1.0, 0.0, 1.0])
def test_of_inequalities_that_lack_the_same_to_round_off_the_first_pushes(nudge):
    rows = np.array([[2.0, 1.0], [0.5, 0.25]])
    least = np.array([3.0, 0.75 * (1 + nudge * np.finfo(float).eps)])
    _, multipliers = least_distance(rows, least, np.zeros(2))
    assert multipliers[0] > 0
    assert multipliers[1] == 0


class TestNearestAdmissible:
    @settings(derandomize=True, deadline=None)
    @given(st.integers(0, 2**31), st.integers(1, 4), st.integers(1, 6))
    def test_is_the_projection_on_the_admissible_cone(self, seed, contacts, modes):
        random = np.random.default_rng(seed)
        rows, v = random.normal(size=(contacts, modes)), random.normal(size=modes)
        if contacts > modes:
            return
        after, impulses = nearest_admissible(rows, v)
        assert np.all(rows @ after >= -1e-10)
        assert np.all(impulses >= 0)
        assert abs(impulses @ (rows @ after)) <= 1e-10
        assert after @ after <= v @ v + 1e-12
        assert_allclose(nearest_admissible(rows, after)[0], after, atol=1e-9)
        brute = scipy.optimize.lsq_linear(rows.T, -v, bounds=(0, np.inf), tol=1e-14)
        assert_allclose(np.linalg.norm(after), np.sqrt(2 * brute.cost), atol=1e-6)

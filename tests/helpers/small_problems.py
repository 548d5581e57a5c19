"""Small complementarity problems of the core, solved in one call, and random ones."""

from typing import NamedTuple

import numpy as np

from multiphi_exudyn._core import SmallProblem

NONE = -1
PLAIN, SKEW, COULOMB = "symmetric", "not symmetric", "tied bounds"
SOLVED, EXCLUDED, UNDECIDED = SmallProblem.Outcome.solved, SmallProblem.Outcome.excluded, SmallProblem.Outcome.undecided


class Given(NamedTuple):
    """A (k, r), G or None for A, b, sizes of its terms, bounds, leaders and mu (k,)."""

    rows: np.ndarray
    pushes: np.ndarray | None
    values: np.ndarray
    sizes: np.ndarray
    low: np.ndarray
    high: np.ndarray
    leaders: np.ndarray
    ties: np.ndarray


def posed(rows, pushes, values, sizes, low, high, leaders=None, ties=None):
    """The problem, to be solved."""
    led = None if leaders is None else np.asarray(leaders).tolist()
    return SmallProblem(rows, values, sizes, low, high, pushing_rows=pushes, leaders=led, ratios=ties)


def complementary(rows, pushes, values, sizes, low, high, leaders=None, ties=None, in_turn=0):
    """(x, z, outcome, rows that exclude each other); pushes None: the rows themselves."""
    problem = posed(rows, pushes, values, sizes, low, high, leaders, ties)
    outcome = problem.solve(SmallProblem.Order.in_turn if in_turn else SmallProblem.Order.most_violated)
    return problem.change, problem.multipliers, outcome, problem.excluding


def random_problem(random, kind, k, extra, at_rest):
    """A problem of k rows in k + extra unknowns; some of b zero."""
    k = 2 * (k // 2) if kind == COULOMB else k
    r, half = k + extra, k // 2
    rows, leaders, ties = random.normal(size=(k, r)), np.full(k, NONE), np.zeros(k)
    turn = random.normal(size=(r, r))
    mobility = 0.3 * turn @ turn.T + random.uniform(0, 2) * (turn - turn.T) + 0.1 * np.eye(r)
    pushes = rows @ mobility.T if kind == SKEW else None
    sort = random.integers(0, 3, size=k)
    low = np.choose(sort, [np.zeros(k), -random.uniform(0, 2, size=k), np.full(k, -np.inf)])
    high = np.choose(sort, [np.full(k, np.inf), random.uniform(0, 2, size=k), np.full(k, np.inf)])
    if kind == COULOMB:
        leaders[half:], ties[half:] = np.arange(half), random.uniform(0, 1, size=half)
        low, high = np.zeros(k), np.where(np.arange(k) < half, np.inf, 0.0)
    b = np.where(random.random(k) < at_rest, 0.0, rows @ random.normal(size=r))
    return Given(rows, pushes, b, np.abs(b), low, high, leaders, ties)


def degenerate_problem(random, kind, k, r):
    """The same with rows that are equal, opposite, parallel, zero or combinations of others, and with ties of b."""
    given = random_problem(random, kind, k, 0, 0.3)
    k = len(given.values)
    rows = random.normal(size=(k, r)) if random.random() < 0.8 else random.integers(-1, 2, size=(k, r)).astype(float)
    for i in range(1, k):
        other = rows[random.integers(i)]
        choices = [rows[i], other, -other, 0.0 * other, 10.0 ** random.uniform(-2, 2) * other]
        choices += [random.normal(size=i) @ rows[:i], other + 10.0 ** random.uniform(-13, -3) * random.normal(size=r)]
        rows[i] = choices[random.integers(len(choices))]
    b = rows @ random.normal(size=r) if random.random() < 0.7 else random.integers(-1, 2, size=k).astype(float)
    b = np.where(random.random(k) < 0.3, 0.0, b)
    low, high = given.low.copy(), given.high.copy()
    if kind != COULOMB:
        same = random.random(k) < 0.2
        high[same] = low[same] = np.where(np.isfinite(low[same]), low[same], 0.0)
    pushes = None if kind != SKEW else rows @ (np.eye(r) + 0.4 * random.normal(size=(r, r)))
    sizes = np.abs(b) + (random.random(k) < 0.5) * random.random(k)
    ties = given.ties * random.choice([1.0, 3.0])
    return Given(rows, pushes, b, sizes, low, high, given.leaders, ties)

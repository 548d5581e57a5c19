"""The small complementarity problem: against all 3^k states, symmetric or not, bounds tied to other rows or not."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from small_problems import (
    COULOMB,
    EXCLUDED,
    NONE,
    PLAIN,
    SKEW,
    SOLVED,
    UNDECIDED,
    complementary,
    posed,
    random_problem,
)

from multiphi_exudyn._core import SmallProblem

SURE = 1e-9
Side = SmallProblem.Side


def bounds(low, high, leaders, ties, z):
    """The bounds (k,), (k,) that go with z."""
    wide = np.where(leaders >= 0, ties * z[leaders], 0.0)
    return low - wide, high + wide


def is_complementary(W, b, low, high, leaders, ties, z, tolerance=SURE):
    low, high = bounds(low, high, leaders, ties, z)
    w, small = W @ z + b, tolerance * (1 + np.max(np.abs(z)))
    inside = np.all(z >= low - small) and np.all(z <= high + small)
    wrong = ((z > low + small) & (w > small)) | ((z < high - small) & (w < -small))
    return bool(inside and not np.any(wrong))


def enumerated(W, b, low, high, leaders, ties):
    """All solutions, each once, found in all 3^k states."""
    found = []
    for sides in itertools.product((-1, 0, 1), repeat=len(b)):
        matrix, wanted = W.copy(), -b.copy()
        for i, side in enumerate(sides):
            if side:
                matrix[i], wanted[i] = np.eye(len(b))[i], low[i] if side < 0 else high[i]
                if leaders[i] >= 0:
                    matrix[i, leaders[i]] -= side * ties[i]
        if not np.all(np.isfinite(wanted)) or np.linalg.cond(matrix) > 1e13:
            continue
        z = np.linalg.solve(matrix, wanted)
        new = not any(np.allclose(z, other, rtol=1e-7, atol=1e-7) for other in found)
        if is_complementary(W, b, low, high, leaders, ties, z) and new:
            found.append(z)
    return found


def solved(given, scale=1.0):
    rows, pushes, b, sizes, low, high, leaders, ties = given
    pushes = None if pushes is None else scale * pushes
    return complementary(scale * rows, pushes, b / scale, sizes / scale, low / scale**3, high / scale**3, leaders, ties)


@pytest.mark.parametrize("kind", [PLAIN, SKEW, COULOMB])
@settings(derandomize=True, max_examples=50, deadline=None)
@given(
    st.integers(0, 2**31), st.integers(2, 5), st.integers(0, 2), st.sampled_from([0.0, 0.4]), st.sampled_from([-9, 9])
)
def test_is_the_one_of_all_states_that_is_complementary(kind, seed, k, extra, at_rest, power):
    given = random_problem(np.random.default_rng(seed), kind, k, extra, at_rest)
    rows, pushes, b, _, *rest = given
    W = rows @ (rows if pushes is None else pushes).T
    x, z, answer, _ = solved(given)
    assert answer == SOLVED
    assert_allclose(x, z @ (rows if pushes is None else pushes), rtol=0, atol=1e-11 * (1 + np.max(np.abs(z))))
    expected = enumerated(W, b, *rest)
    assert any(np.allclose(z, one, rtol=1e-6, atol=1e-6) for one in expected)
    assert len(expected) == 1 or kind == COULOMB
    scale = 2.0**power
    scaled = solved(given, scale)
    assert np.array_equal(scaled[1], z / scale**3)


def test_of_parallel_rows_that_reach_zero_together_the_first_one_is_free_whatever_round_off_says():
    """The other row pushes w of all of them to zero at once; which of them bears anything is no round-off."""
    random = np.random.default_rng(5)
    for _ in range(50):
        along, levers = random.uniform(0.2, 1.0, size=2) * (-1.0, 1.0), random.uniform(0.3, 3.0, size=3)
        rows, b = np.array([[1.0, 0.0], *np.outer(levers, along)]), np.r_[-2.0, random.uniform(0.0, 0.3) * levers]
        _, z, answer, _ = complementary(rows, None, b, np.abs(b), np.zeros(4), np.full(4, 1e3))
        assert answer == SOLVED
        assert np.array_equal(z > 0.0, [True, True, False, False])


@settings(derandomize=True, max_examples=50, deadline=None)
@given(st.integers(0, 2**31), st.integers(2, 5), st.integers(3, 12))
def test_redundant_rows_and_nearly_parallel_ones_are_complementary_too(seed, k, digits):
    """Friction on few unknowns: what x is does not hang on which of the rows bears what."""
    random = np.random.default_rng(seed)
    rows = random.normal(size=(k, 3))
    for i in range(1, k):
        if random.random() < 0.6:
            nearly = 0.0 if random.random() < 0.5 else 10.0**-digits
            rows[i] = random.choice([-2.0, 1.0]) * rows[random.integers(i)] + nearly * random.normal(size=3)
    limits, b = random.uniform(0.1, 1, size=k), rows @ random.normal(size=3)
    x, z, answer, _ = complementary(rows, None, b, np.abs(b), -limits, limits)
    assert answer == SOLVED
    assert is_complementary(rows @ rows.T, b, -limits, limits, np.full(k, NONE), np.zeros(k), z, 1e-8)
    order = random.permutation(k)
    other = complementary(rows[order], None, b[order], np.abs(b)[order], -limits[order], limits[order])
    assert_allclose(other[0], x, rtol=0, atol=1e-8)


def test_equal_friction_on_one_point_is_borne_by_both():
    """Two limits of 1 and 2 against a pull of 2.5: it holds; against one of 4 both slip."""
    rows, limits = np.ones((2, 1)), np.array([1.0, 2.0])
    x, z, _, _ = complementary(rows, None, np.full(2, -2.5), np.full(2, 2.5), -limits, limits)
    assert_allclose([x[0], np.sum(z)], 2.5, rtol=1e-15)
    x, z, _, _ = complementary(rows, None, np.full(2, -4.0), np.full(2, 4.0), -limits, limits)
    assert_allclose(z, limits, rtol=0, atol=0)


@pytest.mark.parametrize("pull", [0.8, 2.5, 3.2, 4.0])
def test_redundant_rows_in_turn_come_to_their_bounds_in_turn(pull):
    """The first bears what it can, then the next, whichever of their rows is the longest."""
    levers, most = np.array([1.0, -3.0, 0.5]), np.array([1.0, 2.0, 1.0])
    rows, limits = levers[:, None], most / np.abs(levers)
    values = -pull * levers
    _, z, answer, _ = complementary(rows, None, values, np.abs(values), -limits, limits, in_turn=1)
    assert answer == SOLVED
    assert_allclose(z * levers, np.clip(pull - np.array([0.0, 1.0, 3.0]), 0.0, most), atol=1e-14)


def test_rows_that_exclude_each_other_are_named():
    rows = np.array([[1.0, 0.0], [0.0, 1.0], [-2.0, 0.0]])
    *_, answer, excluded = complementary(
        rows, None, np.array([-1.0, -1.0, -1.0]), np.ones(3), np.zeros(3), np.full(3, np.inf)
    )
    assert answer == EXCLUDED
    assert sorted(excluded) == [0, 2]


def rod(angle, friction):
    """A rod of mass 1, length 2, inertia 1/3, one end on the floor: rows h_n, h_t in (x, y, turn) over sqrt(M)."""
    arm = np.array([-np.cos(angle), -np.sin(angle)])  # from the middle to the end that touches
    rows = np.array([[0.0, 1.0, arm[0]], [1.0, 0.0, -arm[1]]]) / np.sqrt([1.0, 1.0, 1 / 3])
    return rows, np.array([NONE, 0]), np.array([0.0, friction])


def test_rows_that_come_to_zero_at_once_do_not_change_sides_for_ever():
    """One contact at rest, to which the friction of another one drives the structure, and its own friction at zero."""
    W = np.array(
        [
            [0.59733191472623792, 0.0, 0.59733191472623792, -0.57453308670707937],
            [0.0, 0.8639797211645257, 0.0, -0.33620855287948714],
            [0.59733191472623792, 0.0, 1.6284496315066497, -1.8836235329905477],
            [-0.57453308670707937, -0.33620855287948714, -1.8836235329905477, 2.3640320323590407],
        ]
    )
    b, leaders = np.array([0.0, -1.3321739437070392, 0.0, 0.48015792774859745]), np.array([NONE, NONE, 0, 1])
    ties, low = np.array([0.0, 0.0, 0.34176142930911907, 0.0574027466821208]), np.zeros(4)
    high, sizes = np.array([np.inf, np.inf, 0.0, 0.0]), np.array([0.76, 1.33, 1.65, 2.16])
    (expected,) = enumerated(W, b, low, high, leaders, ties)
    for in_turn in (0, 1):
        _, z, answer, _ = complementary(np.linalg.cholesky(W), None, b, sizes, low, high, leaders, ties, in_turn)
        assert answer == SOLVED
        assert_allclose(z, expected, rtol=0, atol=1e-12)


class TestRodOnARoughFloor:
    """One contact, p_n >= 0, |p_t| <= mu p_n: what sticks, slips or jams, in closed form."""

    def impact(self, angle, friction, speeds):
        rows, leaders, ties = rod(angle, friction)
        b = rows @ (np.asarray(speeds, float) * np.sqrt([1.0, 1.0, 1 / 3]))
        zero = np.zeros(2)
        x, p, answer, _ = complementary(rows, None, b, np.abs(b), zero, np.array([np.inf, 0.0]), leaders, ties)
        return rows @ x + b, p, answer, rows @ rows.T, b

    def test_sticks_where_the_cone_allows_it(self):
        after, p, answer, W, b = self.impact(1.0, 0.8, (0.0, -1.0, 0.0))
        assert answer == SOLVED
        assert_allclose(p, np.linalg.solve(W, -b), rtol=1e-13)
        assert_allclose(after, 0.0, atol=1e-15)

    def test_slips_where_it_does_not(self):
        after, p, answer, W, b = self.impact(1.0, 0.1, (3.0, -1.0, 0.0))
        assert answer == SOLVED
        assert p[0] == pytest.approx(-b[0] / (W[0, 0] - 0.1 * W[0, 1]), rel=1e-13)
        assert p[1] == pytest.approx(-0.1 * p[0], rel=1e-14)
        assert after[1] > 0

    def test_a_wrong_push_is_never_an_answer(self):
        """Beyond the friction at which slip pushes the rod into the floor: solved by sticking, or told."""
        for friction in (1.0, 2.0, 5.0):
            for speed in (-3.0, -0.1, 0.1, 3.0):
                _, p, answer, W, b = self.impact(1.2, friction, (speed, -0.2, 0.0))
                assert answer in (SOLVED, UNDECIDED, EXCLUDED)
                if answer == SOLVED:
                    low, high = np.array([0.0, -friction * p[0]]), np.array([np.inf, friction * p[0]])
                    assert is_complementary(W, b, low, high, np.full(2, NONE), np.zeros(2), p)


@pytest.mark.parametrize("seed", [5171, 5710, 7798, 8755, 16593, 24086])
def test_rows_of_one_direction_come_to_zero_together(seed):
    """Each in turn is a hair before the driven one: none of them takes its place, and then gives it back."""
    random = np.random.default_rng(seed)
    row, other = random.normal(size=(2, 6))
    random.choice([1.0, -1.0])
    rows, b = np.array([row, -row, row, other]), random.normal(size=2)
    values, high = np.array([-abs(b[0]), abs(b[0]), -abs(b[0]), b[1]]), random.uniform(0.5, 9.0, size=4)
    low, leaders = np.zeros(4), np.full(4, NONE)
    _, z, answer, _ = complementary(rows, None, values, np.full(4, 3.0), low, high)
    assert answer == SOLVED
    assert is_complementary(rows @ rows.T, values, low, high, leaders, np.zeros(4), z)


def one_row(row, value, low, high):
    """(z, side, outcome) of a single row."""
    problem = posed(np.array([row]), None, np.array([value]), np.array([1.0]), np.array([low]), np.array([high]))
    outcome = problem.solve(SmallProblem.Order.most_violated)
    problem.free_balanced_rows()
    return problem.multipliers[0], problem.sides[0], outcome


@pytest.mark.parametrize(
    ("row", "value", "low", "high", "z", "side"),
    [
        ([2.0], -8.0, 0.0, np.inf, 2.0, Side.free),
        ([2.0], 8.0, 0.0, np.inf, 0.0, Side.below),
        ([2.0], -8.0, -1.0, 1.0, 1.0, Side.above),
        ([2.0], 1e-14, -1.0, 1.0, 0.0, Side.waiting),
        ([0.0], 1.0, -1.0, 1.0, -1.0, Side.below),
        ([0.0], -1.0, -1.0, 1.0, 1.0, Side.above),
    ],
)
def test_of_a_single_row_is_the_formula(row, value, low, high, z, side):
    assert one_row(row, value, low, high) == (z, side, SOLVED)


def test_a_row_that_nothing_moves_is_excluded_by_itself():
    assert one_row([0.0], -1.0, 0.0, np.inf)[2] == EXCLUDED
    rows = np.array([[0.0, 0.0], [1.0, 0.0]])
    *_, answer, excluded = complementary(rows, None, -np.ones(2), np.ones(2), np.zeros(2), np.full(2, np.inf))
    assert (answer, excluded) == (EXCLUDED, [0])


def test_rows_that_are_no_numbers_are_never_solved():
    rows = np.eye(3)
    rows[0, 0] = np.nan
    *_, answer, _ = complementary(rows, None, -np.ones(3), np.ones(3), np.zeros(3), np.full(3, np.inf))
    assert answer == UNDECIDED


def test_sides_say_where_each_row_is():
    """Friction within +-1 of pulls that it bears, does not bear, and that are not there."""
    values = np.array([-0.5, -2.0, 2.0, 0.0])
    problem = posed(np.eye(4), None, values, np.ones(4), -np.ones(4), np.ones(4))
    assert problem.solve(SmallProblem.Order.in_turn) == SOLVED
    assert problem.sides == [Side.free, Side.above, Side.below, Side.waiting]
    assert_allclose(problem.multipliers, [0.5, 1.0, -1.0, 0.0], rtol=1e-15)


def test_of_rows_at_their_bounds_without_w_the_last_becomes_free_if_that_is_asked_for():
    """A pull of a hair more than both limits: whether they slip is round-off. One of two equal rows is independent."""
    rows, values, limits = np.ones((2, 1)), np.full(2, -2.0 * (1 + 1e-12)), np.ones(2)
    problem = posed(rows, None, values, np.full(2, 2.0), -limits, limits)
    assert problem.solve(SmallProblem.Order.in_turn) == SOLVED
    assert problem.sides == [Side.above, Side.above]
    problem.free_balanced_rows()
    assert problem.sides == [Side.above, Side.free]
    assert_allclose(problem.multipliers, limits, rtol=0, atol=0)


def test_a_problem_is_solved_again_as_if_for_the_first_time():
    given = random_problem(np.random.default_rng(1), COULOMB, 4, 1, 0.0)
    problem = posed(*given)
    results = []
    for _ in range(2):
        assert problem.solve(SmallProblem.Order.in_turn) == SOLVED
        results.append(np.concatenate([problem.change, problem.multipliers]))
    assert np.array_equal(*results)


def test_arrays_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="sizes: need one number for every row"):
        SmallProblem(np.eye(2), np.ones(2), np.ones(3), np.zeros(2), np.ones(2))
    with pytest.raises(ValueError, match="leaders"):
        SmallProblem(np.eye(2), np.ones(2), np.ones(2), np.zeros(2), np.ones(2), leaders=[-1, 2])
    with pytest.raises(ValueError, match="pushing_rows"):
        SmallProblem(np.eye(2), np.ones(2), np.ones(2), np.zeros(2), np.ones(2), pushing_rows=np.eye(3))


FRICTION = np.array([-1, -1, 0, 1]), np.zeros(4), np.array([np.inf, np.inf, 0.0, 0.0])  # leaders, bounds of two pairs
LEFT = {  # rows, b, mu of both pairs, z, sides of the rows
    "by a contact of the same direction": (
        [[1, 0], [1, 0], [0, -1], [0, 0]], [-1, -2, 0, 0], [0.5, 0.5],
        [0, 2, 0, 1], [Side.below, Side.free, Side.below, Side.above],
    ),
    "by one that slides": (
        [[1, -1, 0], [0, -1, -1], [0, 0, 1], [-1, 0, -1]], [-1, -2, 0, 2], [0.5, 1.0],
        [0, 2, 0, -2], [Side.below, Side.free, Side.below, Side.below],
    ),
    "by one that slides against it": (
        [[1, 1, 0, -1], [1, 1, 1, -1], [1, 0, 0, 1], [0, -1, -1, 0]], [-1, -2, 0, 0], [1.0, 0.5],
        [0, 2 / 3, 0, 1 / 3], [Side.below, Side.free, Side.below, Side.above],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", LEFT)
def test_friction_ends_with_the_contact_that_another_one_relieves(name):
    """A row tied to one that comes to zero is fixed with it, though its own w is zero."""
    rows, b, ratios, z, sides = LEFT[name]
    (leaders, low, high), b = FRICTION, np.array(b, float)
    problem = posed(np.array(rows, float), None, b, np.abs(b), low, high, leaders, np.array([0.0, 0.0, *ratios]))
    assert problem.solve(SmallProblem.Order.in_turn) == SOLVED
    assert_allclose(problem.multipliers, z, rtol=0, atol=1e-15)
    assert problem.sides == sides


PARALLEL = {  # rows that are parallel to 1e-9 and less, b, sizes, bounds, mu of the second on the first, z
    "impulses": (
        [[0.584589013331563, -0.17625723488071657, -0.30217854839422587],
         [0.5845890133320709, -0.17625723488261227, -0.30217854839100355]],
        [-0.18569420846301807, -0.18569420846464524], [0.18569420846301807, 0.38210400313279214],
        [-0.7675786300746457, 0.0], [1.913118593624935, np.inf], 0.0, [0.40009714557572984, 0.0],
    ),
    "one without bounds": (
        [[0.23022482996217958, 1.550707472871845, -1.094738106701011],
         [0.23022482996200686, 1.550707472870543, -1.0947381067021005]],
        [-0.31007359099517484, -0.31007359099598797], [0.31007359099517484, 0.31007359099598797],
        [-np.inf, -1.564487319276959], [np.inf, 1.3494643571776241], 0.0, [1.6492961221301066, -1.564487319276959],
    ),
    "friction": (
        [[0.6231126278955524, 0.7853860132946555, 0.16339559406838844],
         [0.6231126278957283, 0.7853860132941253, 0.16339559406929438]],
        [-0.40729766179355076, -0.4072976617930615], [0.9304190460343049, 0.4072976617930615],
        [0.0, 0.0], [np.inf, 0.0], 1.8272169354537493, [0.13962327640297248, 0.25512201522705114],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", PARALLEL)
def test_a_row_that_depends_on_a_free_one_may_lack_what_its_remainder_allows(name):
    """Its violation, above round-off, is none that shares of rows so nearly parallel could make up for."""
    rows, b, sizes, low, high, ratio, z = PARALLEL[name]
    leaders = [NONE, 0] if ratio else [NONE, NONE]
    rows, *numbers = (np.array(part) for part in (rows, b, sizes, low, high))
    problem = posed(rows, None, *numbers, leaders, np.array([0.0, ratio]))
    assert problem.solve(SmallProblem.Order.most_violated) == SOLVED
    assert_allclose(problem.multipliers, z, rtol=1e-9, atol=1e-12)

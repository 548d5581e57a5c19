"""The step test on a solver's arrays: rows that have to exceed the energy norm of the velocities at both ends."""

import numpy as np
import pytest

import multiphi_exudyn._core as core

S, POINTS, HELD, CHANNELS = 2, 1, 1, 2
WIDTH = 3 * S + 1 + POINTS + HELD + CHANNELS
STEP = 0.1


class Solver:
    """Arrays of a solver, and the same test by the formula."""

    def __init__(self, seed=0, point_forces=True, scale=1.0):
        self.random = np.random.default_rng(seed)
        self.rows = self.random.normal(size=(5, WIDTH))
        self.rows[:, 3 * S] = 8.0 * scale
        if not point_forces:
            self.rows[:, 3 * S + 1] = 0.0
        self.norm = 0.3 * self.random.normal(size=(2 * S, 3 * S))
        self.q, self.q_t, self.q_tt, self.multipliers = *np.zeros((3, S)), np.zeros(3)
        conditions = core.StepConditions(
            rows=self.rows,
            end_count=4,
            first_at_start=2,
            norm=self.norm,
            points=POINTS,
            held=HELD,
            channels=CHANNELS,
            has_point_forces=point_forces,
        )
        arrays = self.q, self.q_t, self.q_tt, self.multipliers
        self.test = core.StepTest(conditions, STEP, 1e-9, *arrays, [2])

    def drawn(self):
        x = self.random.normal(size=WIDTH)
        x[3 * S] = 1.0
        return x

    def move_to(self, t, x):
        self.q[:], self.q_t[:], self.q_tt[:] = np.split(x[: 3 * S], 3)
        self.multipliers[2] = x[3 * S + 1]
        self.test.set_end_channels(t, x[-CHANNELS:])

    def speed(self, x):
        return np.linalg.norm(self.norm @ x[: 3 * S])

    def is_clear(self, start, end):
        limit = max(self.speed(start), self.speed(end))
        point = 3 * S + 1
        limit += np.max(np.abs(self.rows[:, point] * (end[point] - start[point]))) / 2
        return bool(np.all(self.rows[2:] @ start > limit) and np.all(self.rows[:4] @ end > limit))


@pytest.mark.parametrize("point_forces", [True, False])
def test_it_is_the_formula_at_both_ends(point_forces):
    found = set()
    for seed in range(60):
        solver = Solver(seed, point_forces)
        start, end = solver.drawn(), solver.drawn()
        end[-CHANNELS - HELD : -CHANNELS] = start[-CHANNELS - HELD : -CHANNELS]
        solver.test.begin(1.0, start, True)
        solver.move_to(1.0 + STEP, end)
        is_clear = solver.test.is_step_clear(1.0 + STEP)
        assert is_clear == solver.is_clear(start, end)
        found.add(is_clear)
        assert solver.test.time == (1.0 + STEP if is_clear else 1.0)
        np.testing.assert_array_equal(solver.test.start, (end if is_clear else start)[: 3 * S + 1 + POINTS])
    assert found == {True, False}


def test_the_end_of_a_clear_step_is_the_start_of_the_next_one():
    solver, x = Solver(scale=10.0), np.zeros(WIDTH)
    x[3 * S] = 1.0
    solver.test.begin(0.0, x, True)
    for k in range(1, 4):
        x[0] = 0.01 * k
        solver.move_to(k * STEP, x)
        assert solver.test.is_step_clear(k * STEP)
        assert solver.test.start[0] == 0.01 * k


def test_other_steps_are_never_clear():
    solver, x = Solver(scale=10.0), np.zeros(WIDTH)
    x[3 * S] = 1.0
    solver.move_to(STEP, x)
    assert not solver.test.is_step_clear(STEP)  # before any step has begun
    solver.test.begin(0.0, x, False)
    assert not solver.test.is_step_clear(STEP)  # a guard that is not armed
    solver.test.begin(0.0, x, True)
    assert not solver.test.is_step_clear(2 * STEP)  # of another length
    solver.test.set_end_channels(2 * STEP, x[-CHANNELS:])
    assert not solver.test.is_step_clear(STEP)  # channels of another time
    solver.move_to(STEP, x)
    assert solver.test.is_step_clear(STEP)
    x[0] = np.nan
    solver.move_to(2 * STEP, x)
    assert not solver.test.is_step_clear(2 * STEP)

"""Several rigid friction elements: which stick and which slip is decided together, redundant ones included.

Compared with an integrator of its own: matrix exponentials in steps, events by bisection, and at each of them all 3^k
states tried, of which that is taken whose motion is admissible right after.
"""

import itertools

import numpy as np
import pytest
import scipy.linalg
from lawful import assert_lawful
from numpy.testing import assert_allclose

import multiphi_exudyn as mp

AHEAD, STEP = 1e-5, 5e-3


class Integrator:
    """M x'' + K x = f - H^T T, |T| <= limits."""

    def __init__(self, mass, stiffness, load, rows, limits):
        self.push, self.stiffness, self.load, self.rows, self.limits = (
            np.linalg.inv(mass), stiffness, load, rows, limits,
        )  # fmt: skip
        self.n = len(mass)

    def parts(self, states):
        """Those that stick, what they bear per force, the forces of the others and the loads."""
        stuck = [i for i, state in enumerate(states) if state == 0]
        force = self.load - self.rows.T @ (np.array(states) * self.limits)
        rows = self.rows[stuck]
        bears = np.linalg.pinv(rows @ self.push @ rows.T, rcond=1e-10) @ rows @ self.push
        return stuck, bears, force

    def after(self, states, z, time):
        n, (stuck, bears, force) = self.n, self.parts(states)
        free = self.push @ (np.eye(n) - self.rows[stuck].T @ bears)
        matrix = np.zeros((2 * n + 1, 2 * n + 1))
        matrix[:n, n:-1], matrix[n:-1, :n], matrix[n:-1, -1] = np.eye(n), -free @ self.stiffness, free @ force
        return scipy.linalg.expm(matrix * time) @ z

    def signals(self, states, z):
        stuck, bears, force = self.parts(states)
        borne = bears @ (force - self.stiffness @ z[: self.n])
        slips = [state * (row @ z[self.n : -1]) for state, row in zip(states, self.rows, strict=True) if state]
        return np.concatenate([self.limits[stuck] - np.abs(borne), slips])

    def decided(self, states, z):
        speeds = self.rows @ z[self.n : -1]
        resting = np.abs(speeds) <= 1e-9 * (1 + np.max(np.abs(z)))
        choices = [(0, 1, -1) if rests else (int(np.sign(v)),) for rests, v in zip(resting, speeds, strict=True)]
        for new in sorted(itertools.product(*choices), key=lambda new: np.count_nonzero(np.subtract(new, states))):
            start, rows = z.copy(), self.rows[self.parts(new)[0]]
            start[self.n : -1] -= self.push @ rows.T @ np.linalg.pinv(rows @ self.push @ rows.T) @ rows @ z[self.n : -1]
            if all(np.all(self.signals(new, self.after(new, start, t)) >= -1e-10) for t in (AHEAD / 2, AHEAD)):
                return new, start
        raise AssertionError("no state is admissible")

    def run(self, displacement, velocity, t_end):
        z, t = np.concatenate([displacement, velocity, [1.0]]), 0.0
        states, z = self.decided((0,) * len(self.rows), z)
        while t < t_end:
            low, high = 0.0, min(STEP, t_end - t)
            ahead = self.after(states, z, high)
            if np.all(self.signals(states, ahead) >= -1e-11):
                z, t = ahead, t + high
                continue
            while high - low > 1e-15:
                middle = (low + high) / 2
                wrong = np.any(self.signals(states, self.after(states, z, middle)) < -1e-13)
                low, high = (low, middle) if wrong else (middle, high)
                if middle in (low, high) and high - low < 1e-14:
                    break
            z, t = self.after(states, z, high), t + high
            states, z = self.decided(states, z)
        return z[: self.n]


def elements(rows, limits):
    return [mp.Friction(f"f{i}", row, limit) for i, (row, limit) in enumerate(zip(rows, limits, strict=True))]


def simulated(mass, stiffness, load, rows, limits, displacement, velocity, t_end):
    structure, n = mp.LinearStructure(mass, stiffness), len(mass)
    model = mp.MultiPhiModel(structure, elements(rows, limits), modes="all")
    loads = [mp.ConstantLoad(np.eye(n)[i], load[i]) for i in range(n)]
    return mp.simulate(model, t_end, displacement=displacement, velocity=velocity, loads=loads)


@pytest.mark.parametrize("redundant", [False, True])
@pytest.mark.parametrize("seed", [0, 1, 2])  # of three freedoms and one, of two without springs
def test_random_ones_move_as_an_integrator_says(seed, redundant):
    """Also without springs, where all come to rest at one instant; redundant: more of them than unknowns."""
    random = np.random.default_rng(100 + seed)
    n, turn = int(random.integers(1, 4)), random.normal(size=(3, 3))
    k = n + 2 if redundant else n
    mass, stiffness = np.diag(random.uniform(0.5, 2, n)), (turn @ turn.T)[:n, :n] * random.choice([0.0, 2.0])
    rows, limits = random.normal(size=(k, n)), np.round(random.uniform(0.1, 0.6, k), 1)
    load, start = random.normal(size=n), (random.normal(size=n), random.normal(size=n))
    run = simulated(mass, stiffness, load, rows, limits, *start, 3.0)
    assert run.status == "ok"
    assert_allclose(run.displacement(3.0), Integrator(mass, stiffness, load, rows, limits).run(*start, 3.0), atol=1e-8)


def test_two_on_one_point_are_one_with_the_sum_of_their_limits():
    structure, load = mp.LinearStructure([[1.0]], [[4.0]], points={"m": 0}), mp.HarmonicLoad("m", 1.0, 0.2)
    runs = [
        mp.simulate(mp.MultiPhiModel(structure, elements(["m"] * len(limits), limits), modes="all"), 20.0, loads=[load])
        for limits in ([0.3], [0.1, 0.2], [0.2, 0.05, 0.05])
    ]
    t = np.linspace(0, 20, 201)
    assert [run.status for run in runs] == ["ok"] * 3
    for run in runs[1:]:
        assert_allclose(run.at("m", t), runs[0].at("m", t), rtol=0, atol=1e-14)
        assert run.ledger.residual == pytest.approx(0.0, abs=1e-12)


def test_a_body_on_three_pads_turns_and_comes_to_rest():
    """Two unknowns, three pads: the same as an integrator, and it rests for ever."""
    mass, rows, limits = np.diag([3.0, 1.0]), np.array([[1.0, -1.0], [1.0, 0.0], [1.0, 1.0]]), np.full(3, 0.3)
    given = mass, np.zeros((2, 2)), np.zeros(2), rows, limits
    run = simulated(*given, np.zeros(2), [1.0, 0.8], 20.0)
    assert run.status == "ok"
    assert_allclose(run.displacement(4.0), Integrator(*given).run(np.zeros(2), [1.0, 0.8], 4.0), atol=1e-9)
    assert np.all(run.velocity(20.0) == 0.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_one_that_turns_does_not_tear_another_one_loose(sign):
    """A carrier turns on the floor and falls to its limit there: its load bears (4 + 1) / 2 < 3.2, and stays stuck.

    While the floor bore its static limit it would bear (4 + 3) / 2.
    """
    structure = mp.LinearStructure(np.eye(2), np.zeros((2, 2)), points={"carrier": 0, "load": 1})
    held = mp.Friction("held", {"load": 1.0, "carrier": -1.0}, 1.0, static_limit=3.2)
    model = mp.MultiPhiModel(structure, [mp.Friction("floor", "carrier", 1.0, static_limit=3.0), held], modes="all")
    run = mp.simulate(model, 1.0, velocity=[sign, sign], loads=[mp.ConstantLoad("load", -4.0 * sign)])
    assert {event.contact for event in run.events} == {"floor"}
    assert_allclose(run.displacement(0.4), sign * 0.2, rtol=1e-12)
    assert_allclose(run.displacement(1.0), sign * (0.2 - 0.75 * 0.6**2), rtol=1e-12)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("beside", [(), ("other",)])
@pytest.mark.parametrize("force", [2.2, 3.2])
def test_what_holds_once_a_stop_lets_go_does_not_fall_beside_it(force, beside, sign):
    """A load comes to rest on a carrier that 1.1 N press on its stop, with limits 1 and, at rest, 2.

    2.2 N pull the load: on the stop the carrier would bear them, 1.1 N from it, and so they leave it as one body, the
    load held with (1.1 + 2.2) / 2 < 2. With 3.2 N it falls, as (1.1 + 3.2) / 2 > 2, and the carrier stays. What rests
    elsewhere changes nothing.
    """
    names = ("carrier", "load", *beside)
    structure = mp.LinearStructure(
        np.eye(len(names)), np.zeros((len(names),) * 2), points={name: k for k, name in enumerate(names)}
    )
    elements = [
        mp.UnilateralContact("stop", {"carrier": -sign}, 0.0),
        mp.Friction("held", {"carrier": 1.0, "load": -1.0}, 1.0, static_limit=2.0),
        *(mp.Friction(f"under {name}", name, 1.0) for name in beside),
    ]
    model, speed = mp.MultiPhiModel(structure, elements, modes="all"), np.zeros(len(names))
    speed[1] = sign * (force + 1.0)
    loads = [mp.ConstantLoad("carrier", 1.1 * sign), mp.ConstantLoad("load", -force * sign)]
    run = mp.simulate(model, 2.0, velocity=speed, loads=loads)
    together, alone = (0.5 * (force - 1.1), 0.0) if force < 3.0 else (0.0, force - 1.0)
    assert_allclose(run.at("carrier", 2.0), -sign * 0.5 * together, rtol=1e-12, atol=1e-14)
    assert_allclose(run.at("load", 2.0), sign * (0.5 * (force + 1.0) - 0.5 * (together + alone)), rtol=1e-12)
    assert run.ledger.residual == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
@pytest.mark.parametrize(
    ("mass", "coupling", "limit", "scale"),
    [(1.0, 0.3, 8.0, 0.9), (1.0, 0.3, 8.0, 1.0), (1.0, -0.3, 2.0, 1.0), (1.3, 0.3, 0.5, 1.07)],
)
def test_who_has_a_static_limit_takes_over_from_one_that_is_at_its_limit_to_round_off(
    mass, coupling, limit, order, scale
):
    """Limits 0.2, 0.3 and 1 of one motion, the last one 2 at rest, are one of 1.5 and 2.5, beside friction elsewhere.

    That pulls through the mass: on the way to the answer one of them comes to its limit but for round-off.
    """
    structure = mp.LinearStructure(
        [[1.0, coupling], [coupling, mass]], np.diag([4.0, 3.0]), points={"m": 0, "elsewhere": 1}
    )
    beside, load = mp.Friction("beside", "elsewhere", limit), mp.HarmonicLoad("m", 5.0, 0.25, -np.pi / 2)
    limits = np.array([(0.2, 0.2), (0.3, 0.3), (1.0, 2.0)])[list(order)] * scale
    several = [mp.Friction(f"f{k}", "m", low, static_limit=high) for k, (low, high) in enumerate(limits)]
    one = [mp.Friction("one", "m", 1.5 * scale, static_limit=2.5 * scale)]
    runs = [
        mp.simulate(mp.MultiPhiModel(structure, [beside, *parts], modes="all"), 1.0, loads=[load])
        for parts in (one, several)
    ]
    t = np.linspace(0, 1, 101)
    assert [run.status for run in runs] == ["ok"] * 2
    assert_allclose(runs[1].at("m", t), runs[0].at("m", t), rtol=0, atol=1e-13)


@pytest.mark.parametrize("spring", [2e4, 1e5])
@pytest.mark.parametrize("weight", [0.0, 1.0])
def test_a_block_lets_go_beside_a_stiff_spring_that_holds_it_too(weight, spring):
    """Its speed begins with round-off of what the spring's mode makes of the displacement: the slip does not end."""
    along = np.array([1.574501, -0.226633])
    structure = mp.LinearStructure(
        [[1.249432, 0.496701], [0.496701, 2.013816]], [[7.222403, 2.48364], [2.48364, 11.515575]]
    )
    pair = [mp.Friction("b", along, 1.0), mp.Friction("j", -along, 1.9, stiffness=spring)]
    loads = [mp.HarmonicLoad([1.68, 0.9927], 5.56, 0.268), mp.ConstantLoad([1.7, 2.5], -weight)]
    run = mp.simulate(mp.MultiPhiModel(structure, pair, modes="all"), 6.3, loads=loads)
    assert run.status == "ok"
    assert len(run.events) < 40
    assert abs(run.ledger.residual) < 1e-12 * run.ledger.friction


@pytest.mark.parametrize("speed", [0.565, 0.3])
@pytest.mark.parametrize("mass", [1.0, 1.3, 1.6, 2.0])
def test_two_that_stick_to_each_other_come_to_rest_on_a_belt_as_one_body(mass, speed):
    """No unknown is left there: the round-off of the belt's speed is no speed that something could take away."""
    pull, runs = mp.HarmonicLoad("a", 2.05, 1.23), []
    for masses, stiffness in ((np.diag([1.26, mass]), [[40.0, -40.0], [-40.0, 40.0]]), ([[1.26 + mass]], [[0.0]])):
        structure = mp.LinearStructure(masses, stiffness, points={"a": 0})
        belt = mp.Friction("belt", {"a": -1.0}, 1.05, velocity=speed)
        joint = [mp.Friction("joint", [-1.0, 1.0], 8.8)] if len(stiffness) > 1 else []
        start = np.full(len(stiffness), 0.3)
        runs.append(mp.simulate(mp.MultiPhiModel(structure, [belt, *joint], modes="all"), 6.0, None, start, [pull]))
    t = np.linspace(0, 6, 61)
    assert [run.status for run in runs] == ["ok"] * 2
    assert_allclose(runs[0].at("a", t), runs[1].at("a", t), rtol=0, atol=1e-12)
    assert np.any(np.diff(runs[0].stick_intervals("belt")) > 0)


@pytest.mark.parametrize("damping", [0.0, 1.0])
@pytest.mark.parametrize("stiffness", [4.0, 50.0])
@pytest.mark.parametrize("far", [1.0, 10.0])
@pytest.mark.parametrize("earlier", [1e-12, 2e-13, 5e-14, 0.0, -2e-13])
def test_a_rough_stop_that_opens_as_another_element_comes_to_rest_keeps_its_slip_velocity(
    earlier, far, stiffness, damping
):
    """The instants differ by round-off of the stop's force: it still slides with 5 m/s."""
    structure = mp.LinearStructure(np.eye(3), np.zeros((3, 3)), None, {"slider": 0, "y": 1, "x": 2})
    floor = mp.UnilateralContact("floor", "y", -far, stiffness, damping, friction=0.25, tangential="x")
    model = mp.MultiPhiModel(structure, [floor, mp.Friction("guide", "slider", 1.0)], modes="all")
    place, velocity = np.array([0.0, far, 0.0]), np.array([0.0, -0.01, 5.0])
    alone = mp.simulate(model, 10.0, place, velocity)
    opens = next(event.time for event in alone.events if event.contact == "floor" and event.kind == "open")
    velocity[0] = opens - earlier
    run = mp.simulate(model, 2 * opens, place, velocity)
    assert_lawful(run, start=(place, velocity), round_off=1e-11)
    assert run.velocity(2 * opens)[2] == pytest.approx(float(alone.velocity(2 * opens)[2]), rel=1e-9)

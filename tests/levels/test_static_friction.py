"""Rest under slowly applied forces with friction, and runs that start there."""

import math
import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose
from small_structures import chain, random_structure

import multiphi_exudyn as mp
from reference_models.rig import rig_beam, rig_damping


def block(*elements):
    return mp.MultiPhiModel(mp.LinearStructure([[1.0]], [[4.0]], points={"m": 0}), elements, modes="all")


class TestOneBlock:
    """k 4, limit 2, alone or with a spring of 25 in series."""

    @pytest.mark.parametrize(
        ("force", "x", "stretch"), [(1.0, 1 / 29, 1 / 29), (10.0, 2.0, 0.08), (-10.0, -2.0, -0.08)]
    )
    def test_with_a_spring(self, force, x, stretch):
        found = block(mp.Friction("ring", "m", 2.0, stiffness=25.0)).equilibrium({"m": force})
        assert_allclose([*found.displacement, found.stretches["ring"]], [x, stretch], rtol=1e-13)

    @pytest.mark.parametrize(("force", "x"), [(1.9, 0.0), (10.0, 2.0), (-10.0, -2.0)])
    def test_without(self, force, x):
        model = block(mp.Friction("ring", "m", 2.0))
        assert_allclose(model.static_equilibrium({"m": force}), [x], rtol=1e-13, atol=1e-15)
        assert model.equilibrium({"m": force}).stretches == {"ring": 0.0}

    def test_that_lets_go_with_a_jump_is_refused(self):
        model = block(mp.Friction("ring", "m", 2.0, 3.0, 25.0))
        assert_allclose(model.static_equilibrium({"m": 1.0}), [1 / 29], rtol=1e-13)
        with pytest.raises(mp.NumericalFailure, match="'ring' slips at its static limit"):
            model.static_equilibrium({"m": 10.0})


class TestRuns:
    @pytest.mark.parametrize("stiffness", [25.0, math.inf])
    @pytest.mark.parametrize("force", [1.0, 10.0])
    def test_under_the_same_force_stay_at_rest(self, stiffness, force):
        model = block(mp.Friction("ring", "m", 2.0, stiffness=stiffness))
        start = model.equilibrium({"m": force})
        run = mp.simulate(model, 5.0, start=start, loads=[mp.ConstantLoad("m", force)])
        assert not run.events
        assert_allclose(run.at("m", np.linspace(0, 5, 21)), start.displacement[0], rtol=1e-14, atol=1e-16)
        assert_allclose(
            run.friction_force("ring", 2.0), min(force * (25 / 29 if stiffness < 1e9 else 1), 2.0), rtol=1e-12
        )

    @pytest.mark.parametrize("stiffness", [1e6, math.inf])
    @pytest.mark.parametrize("force", [0.3, 2.0])
    def test_under_the_same_force_stay_at_rest_with_four_modes(self, stiffness, force):
        """What modes leave out is in the level's state of rest: static residuals of load, friction and held place."""
        beam = mp.planar_beam(rig_beam(), elements=20, damping=rig_damping())
        model = mp.MultiPhiModel(beam, [mp.Friction("ring", "node2", 0.6, stiffness=stiffness)], modes=4)
        start = model.equilibrium({"node3": force})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            run = mp.simulate(model, 1.0, start=start, loads=[mp.ConstantLoad("node3", force)])
        assert not run.events
        assert_allclose(run.displacement(np.array([0.3, 1.0])).T, [start.displacement] * 2, rtol=1e-11, atol=1e-16)

    def test_let_go_have_the_energy_of_the_stretched_spring(self):
        """It unloads on both springs first, k + k_t = 29, from the force that is gone: until T = -2."""
        model = block(mp.Friction("ring", "m", 2.0, stiffness=25.0))
        run = mp.simulate(model, 20.0, start=model.equilibrium({"m": 10.0}))
        assert run.ledger.initial == pytest.approx(0.5 * 4 * 2.0**2 + 0.5 * 25 * 0.08**2, rel=1e-14)
        assert run.energy(0.0) == pytest.approx(run.ledger.initial, rel=1e-14)
        assert run.ledger.truncation_strain == pytest.approx(0.0, abs=1e-13)
        first = run.events[0]
        middle = 2.0 - 10.0 / 29.0
        assert first.kind == "slip"
        assert first.time == pytest.approx(
            math.acos((2.0 - 0.16 - middle) / (2.0 - middle)) / math.sqrt(29.0), rel=1e-12
        )
        assert abs(run.ledger.residual) < 1e-13 * run.ledger.initial
        nudged = run.again(run.start.displacement, run.start.velocity, {})
        assert [event.time for event in nudged.events] == [event.time for event in run.events]

    def test_from_the_displacement_alone_begin_with_springs_at_rest(self):
        model = block(mp.Friction("ring", "m", 2.0, stiffness=25.0))
        run = mp.simulate(model, 1.0, displacement=model.static_equilibrium({"m": 10.0}))
        assert run.friction_force("ring", 0.0) == pytest.approx(0.0, abs=1e-14)

    def test_refuse_an_equilibrium_of_other_friction(self):
        given = block(mp.Friction("ring", "m", 2.0)).equilibrium({"m": 1.0})
        with pytest.raises(mp.MultiPhiValueError, match="with the friction ring, need that of the model, none"):
            mp.simulate(block(), 1.0, start=given)
        with pytest.raises(mp.MultiPhiValueError, match="got a displacement or velocity as well"):
            mp.simulate(block(mp.Friction("ring", "m", 2.0)), 1.0, start=given, velocity=[1.0])


@pytest.mark.parametrize("seed", range(8))
def test_is_where_a_slow_run_leads(seed):
    """Chains with springs, friction without springs and a stop, loaded in 3000 s and damped so that nothing swings."""
    n, mass, _, _, random = random_structure(seed)
    given = random.uniform(5.0, 50.0, n)
    springs = np.diag(given + np.append(given[1:], 0.0)) - np.diag(given[1:], 1) - np.diag(given[1:], -1)
    structure = mp.LinearStructure(
        mass, springs, damping=mp.ModalDamping([0.7] * n), points={f"m{i}": i for i in range(n)}
    )
    places = [f"m{i}" for i in random.permutation(n)]
    elements = [
        mp.Friction("one", places[0], 0.3, stiffness=30.0),
        mp.Friction("two", {places[1]: 1.0, places[2]: -1.0}, 0.1, stiffness=12.0),
        mp.Friction("three", places[1], 0.2),
        mp.UnilateralContact("stop", places[2], 0.05, 300.0),
    ]
    model = mp.MultiPhiModel(structure, elements, modes="all")
    forces = {places[0]: 1.5, places[1]: -1.0}
    found = model.equilibrium(forces)
    loads = [mp.SampledLoad(at, [0.0, 3000.0, 4000.0], [0.0, force, force]) for at, force in forces.items()]
    run = mp.simulate(model, 3100.0, loads=loads)
    assert_allclose(
        found.displacement, run.displacement(3100.0), rtol=0, atol=3e-4 * np.max(np.abs(found.displacement))
    )
    for element in elements[:2]:
        force = element.stiffness * found.stretches[element.name]
        assert_allclose(force, run.friction_force(element.name, 3100.0), rtol=0, atol=1e-3 * element.limit)


def test_friction_that_others_turn_back_sticks_again():
    """The middle one of three slips until its neighbour does, and is then drawn back: the path remembers it."""
    structure = chain(3, stiffness=10.0)
    elements = [mp.Friction(f"at{i}", f"m{i}", limit, stiffness=40.0) for i, limit in enumerate((0.5, 0.01, 0.2))]
    model = mp.MultiPhiModel(structure, elements, modes="all")
    for force in (0.1, 0.5, 1.0, 3.0):
        found = model.equilibrium({"m2": force, "m0": -0.7 * force})
        forces = np.array([40.0 * found.stretches[f"at{i}"] for i in range(3)])
        assert np.all(np.abs(forces) <= [0.5 * (1 + 1e-12), 0.01 * (1 + 1e-12), 0.2 * (1 + 1e-12)])
        load = np.array([-0.7 * force, 0.0, force])
        assert_allclose(structure.stiffness @ found.displacement, load - forces, rtol=0, atol=1e-13)


class TestContacts:
    """A block on springs, pressed onto a floor at an angle to them: friction and pressure change each other."""

    STIFFNESS = np.array([[10.0, 2.0], [2.0, 20.0]])

    def model(self, friction=0.4, spring=math.inf, gap=0.05, **given):
        structure = mp.LinearStructure(np.eye(2), self.STIFFNESS, points={"x": 0, "y": 1})
        floor = mp.UnilateralContact(
            "floor", "y", gap, 80.0, friction=friction, tangential="x", tangential_stiffness=spring, **given
        )
        return mp.MultiPhiModel(structure, [floor], modes="all")

    @pytest.mark.parametrize("stiffness", [math.inf, 80.0])
    @pytest.mark.parametrize(("friction", "force"), [(0.4, (7.457, 0.7)), (4.0, (7.457, 0.9957))])
    def test_of_no_gap_that_would_be_pulled_at_if_they_stuck_slide_at_once(self, stiffness, friction, force):
        """Sticking at zero leaves the floor a force that pulls: the block slides, and is pressed on by its spring."""
        structure = mp.LinearStructure(np.eye(2), self.STIFFNESS, points={"x": 0, "y": 1})
        floor = mp.UnilateralContact("floor", "y", 0.0, stiffness, friction=friction, tangential="x")
        found = mp.MultiPhiModel(structure, [floor], modes="all").static_equilibrium(
            dict(zip("xy", force, strict=True))
        )
        yielding = 1 / stiffness  # N = -stiffness y
        unknown = np.linalg.solve([[10.0, friction - 2.0 * yielding], [2.0, -1.0 - 20.0 * yielding]], force)
        assert unknown[1] > 0
        assert_allclose(found, [unknown[0], -yielding * unknown[1]], atol=1e-12)

    @pytest.mark.parametrize("spring", [math.inf, 40.0])
    @pytest.mark.parametrize("force", [(3.0, -6.0), (0.5, -1.0), (-8.0, -6.0)])
    def test_slide_where_the_sliding_structure_is_at_rest(self, spring, force):
        found = self.model(spring=spring).equilibrium({"x": force[0], "y": force[1]})
        s = math.copysign(1.0, force[0])
        sliding = self.STIFFNESS + 80.0 * np.array([[0.0, -0.4 * s], [0.0, 1.0]])
        expected = np.linalg.solve(sliding, np.array(force) + 80.0 * 0.05 * np.array([0.4 * s, -1.0]))
        assert_allclose(found.displacement, expected, rtol=1e-13)
        tension = s * 0.4 * -80.0 * (found.displacement[1] + 0.05)
        assert_allclose(found.stretches["floor.tangential"], tension / spring, rtol=1e-12)

    @pytest.mark.parametrize("spring", [math.inf, 40.0])
    def test_stick_where_they_have_touched(self, spring):
        """Until it touches it moves freely; from there on the spring holds it, or nothing moves it."""
        free = np.linalg.solve(self.STIFFNESS, [1.0, -6.0])
        place = free[0] * 0.05 / -free[1]
        found = self.model(spring=spring).equilibrium({"x": 1.0, "y": -6.0})
        if math.isinf(spring):
            expected = [place, (-6.0 - 80 * 0.05 - 2 * place) / 100.0]
        else:
            stuck = self.STIFFNESS + np.diag([spring, 80.0])
            expected = np.linalg.solve(stuck, [1.0 + spring * place, -6.0 - 80 * 0.05])
        assert_allclose(found.displacement, expected, rtol=1e-13)

    @pytest.mark.parametrize("force", [(3.0, -6.0), (0.5, -1.0), (-8.0, -6.0)])
    def test_that_are_rigid_slide_along_their_stop(self, force):
        """10 x - 2 gap = f_x - s mu N,   N = 2 x - 20 gap - f_y."""
        found = self.rigid(0.4).equilibrium({"x": force[0], "y": force[1]})
        s, gap = math.copysign(1.0, force[0]), 0.05
        x = (force[0] + 2 * gap + s * 0.4 * (20 * gap + force[1])) / (10 + 2 * s * 0.4)
        assert_allclose(found.displacement, [x, -gap], rtol=1e-13)

    def test_that_are_rigid_stick_where_they_have_touched(self):
        free = np.linalg.solve(self.STIFFNESS, [1.0, -6.0])
        found = self.rigid(0.4).equilibrium({"x": 1.0, "y": -6.0})
        assert_allclose(found.displacement, [free[0] * 0.05 / -free[1], -0.05], rtol=1e-13)

    def test_that_are_rigid_and_wedge_are_refused_with_their_number(self):
        """A force of 1 N along the stop changes the reaction by 2 / 10 N."""
        with pytest.raises(mp.NumericalFailure, match=r"wedges at the contact 'floor': det\(I - W\) = -0\.4,"):
            self.rigid(7.0).equilibrium({"x": 4.64, "y": -0.56})

    def rigid(self, friction):
        structure = mp.LinearStructure(np.eye(2), self.STIFFNESS, points={"x": 0, "y": 1})
        floor = mp.UnilateralContact("floor", "y", 0.05, friction=friction, tangential="x")
        return mp.MultiPhiModel(structure, [floor], modes="all")

    @pytest.mark.parametrize("spring", [math.inf, 40.0])
    @pytest.mark.parametrize("force", [{"x": 1.0, "y": -6.0}, {"x": 3.0, "y": -6.0}])
    def test_stay_there(self, spring, force):
        model = self.model(spring=spring)
        start = model.equilibrium(force)
        run = mp.simulate(model, 5.0, start=start, loads=[mp.ConstantLoad(at, f) for at, f in force.items()])
        assert not run.events
        assert_allclose(run.displacement(5.0), start.displacement, rtol=0, atol=1e-15)

    def test_that_wedge_are_refused_with_their_number(self):
        """Friction presses more than it takes: h_y.K^-1 h_x 80 mu > 1; then it could hold what is to open."""
        stuck = self.STIFFNESS + np.diag([0.0, 80.0])
        share = 80.0 * 7.0 * abs(np.linalg.inv(stuck)[1, 0])
        model, forces = self.model(friction=7.0, gap=-0.05), {"x": 3.0, "y": 8.0}
        with pytest.raises(mp.NumericalFailure, match=rf"'floor': det\(I - W\) = {1 - share:.6g},"):
            model.equilibrium(forces)
        free = np.linalg.solve(self.STIFFNESS, [3.0, 8.0])
        assert_allclose(self.model(friction=0.9 * 7.0 / share, gap=-0.05).equilibrium(forces).displacement, free)

    def test_that_let_go_are_refused(self):
        model = self.model(static_friction=0.5, spring=40.0, gap=-0.05)
        with pytest.raises(mp.NumericalFailure, match="'floor' slips at its static limit"):
            model.equilibrium({"x": 4.0, "y": -1.0})

    @pytest.mark.parametrize("seed", range(4))
    def test_are_where_a_slow_run_leads(self, seed):
        n, mass, _, _, random = random_structure(seed)
        given = random.uniform(5.0, 50.0, n)
        springs = np.diag(given + np.append(given[1:], 0.0)) - np.diag(given[1:], 1) - np.diag(given[1:], -1)
        structure = mp.LinearStructure(
            mass, springs, damping=mp.ModalDamping([0.7] * n), points={f"m{i}": i for i in range(n)}
        )
        places = [f"m{i}" for i in random.permutation(n)]
        elements = [
            mp.UnilateralContact("near", places[0], 0.005, 60.0, friction=0.4, tangential=places[1]),
            mp.UnilateralContact(
                "reached", places[2], 0.02, 200.0, friction=0.5, tangential={places[0]: 1.0, places[1]: 0.5},
                tangential_stiffness=35.0,
            ),
        ]  # fmt: skip
        model = mp.MultiPhiModel(structure, elements, modes="all")
        forces = {places[0]: 1.5, places[1]: -1.0, places[2]: -3.0}
        found = model.equilibrium(forces)
        loads = [mp.SampledLoad(at, [0.0, 12000.0, 16000.0], [0.0, force, force]) for at, force in forces.items()]
        run = mp.simulate(model, 12100.0, loads=loads)
        assert "reached" in {event.contact for event in run.events}
        size = np.max(np.abs(found.displacement))
        assert_allclose(found.displacement, run.displacement(12100.0), rtol=0, atol=3e-4 * size)


@pytest.mark.parametrize("block", ["m1", "m0"])
def test_what_holds_one_motion_together_is_refused_by_name(block):
    """A block beside a rigid contact that rubs along its row, or presses on it: the forces of both are not unique."""
    structure = mp.LinearStructure(np.eye(2), [[300.0, 100.0], [100.0, 200.0]], points={"m0": 0, "m1": 1})
    rough = mp.UnilateralContact("c", {"m0": -1.0}, 0.0, friction=0.1, tangential="m1")
    model = mp.MultiPhiModel(structure, [rough, mp.Friction("f", block, 2.0)], modes="all")
    with pytest.raises(mp.NumericalFailure, match="hold the same motion, so how they share"):
        model.static_equilibrium({"m0": 10.0, "m1": -5.0})

"""A FEMinterface and its linear structure hold the same matrices, supports and points."""

import numpy as np
import pytest
import skfem
from exudyn.FEM import FEMinterface
from skfem.models.elasticity import lame_parameters, linear_elasticity

from multiphi_exudyn import MultiPhiModel, MultiPhiTypeError, MultiPhiValueError, UnilateralContact, simulate
from multiphi_exudyn.exudyn_plugin import linear_structure_from_fem

YOUNG, POISSON, DENSITY, LENGTH = 2.1e11, 0.3, 7850.0, 0.4  # Pa, -, kg/m3, m


@pytest.fixture(scope="module")
def basis():
    mesh = skfem.MeshHex.init_tensor(np.linspace(0, LENGTH, 7), *2 * [np.linspace(0, 0.02, 3)])
    return skfem.Basis(mesh, skfem.ElementVector(skfem.ElementHex1()))


@pytest.fixture
def fem(basis):
    """A block of hexahedra, its ends as node sets; the far one weighted by the areas around its nodes."""
    made = FEMinterface()
    made.nodes = {"Position": basis.mesh.p.T.copy()}
    inertia = skfem.BilinearForm(lambda u, v, _: DENSITY * skfem.helpers.dot(u, v))
    made.massMatrix = inertia.assemble(basis).tocsr()
    made.stiffnessMatrix = linear_elasticity(*lame_parameters(YOUNG, POISSON)).assemble(basis).tocsr()
    for name, x in (("clamp", 0.0), ("end", LENGTH)):
        nodes = basis.mesh.nodes_satisfying(lambda p, x=x: np.isclose(p[0], x))
        inner = np.sum(np.isclose(basis.mesh.p[1:, nodes], 0.01), axis=0)
        made.nodeSets.append({"Name": name, "NodeNumbers": nodes, "NodeWeights": 2.0**inner / 16})
    return made


def test_matrices_are_those_of_the_mesh_without_its_fixed_nodes(fem, basis):
    held = basis.get_dofs(lambda x: np.isclose(x[0], 0)).all()
    free = np.setdiff1d(np.arange(basis.N), held)
    for fixed in ("clamp", fem.nodeSets[0]["NodeNumbers"]):
        structure = linear_structure_from_fem(fem, fixed=fixed)
        assert structure.n == len(free)
        for got, given in ((structure.mass, fem.massMatrix), (structure.stiffness, fem.stiffnessMatrix)):
            assert abs(got - given[free][:, free]).max() <= 1e-15 * abs(given).max()


def test_free_frequencies_are_those_that_exudyn_finds(fem):
    fem.ComputeEigenmodes(6, excludeRigidBodyModes=6, useSparseSolver=False)
    own = MultiPhiModel(linear_structure_from_fem(fem), modes=12).level(()).frequencies
    np.testing.assert_array_equal(own[:6], 0.0)
    assert own[6:] == pytest.approx(fem.GetEigenFrequenciesHz()[6:12], rel=1e-7)


def test_a_set_turns_as_a_rigid_body_does(fem, basis):
    names = ["ux", "uy", "uz", "rx", "ry", "rz"]
    structure = linear_structure_from_fem(fem, (), {name: ("end", c) for c, name in enumerate(names)})
    moved, turned = np.array([1e-4, -2e-4, 3e-4]), np.array([2e-3, -1e-3, 5e-4])
    ends = fem.nodeSets[1]
    middle = ends["NodeWeights"] @ fem.nodes["Position"][ends["NodeNumbers"]]
    field = moved + np.cross(turned, basis.mesh.p.T - middle)
    found = [structure.row(name) @ field.ravel() for name in names]
    assert found == pytest.approx([*moved, *turned], rel=1e-12)


def test_nodes_on_a_line_have_no_rotation_about_it(fem, basis):
    line = basis.mesh.nodes_satisfying(lambda p: np.isclose(p[0], LENGTH) & np.isclose(p[1], 0))
    fem.nodeSets.append({"Name": "edge", "NodeNumbers": line, "NodeWeights": np.ones(len(line))})
    with pytest.raises(MultiPhiValueError, match=r"points\['turn'\]: got nodes on one line"):
        linear_structure_from_fem(fem, "clamp", {"turn": ("edge", 5)})


def test_a_point_is_the_displacement_of_its_node_and_of_its_set_the_mean(fem, basis):
    corner = int(np.argmax(np.sum(basis.mesh.p, axis=0)))
    places = {"corner": (corner, 2), "end": ("end", 2), "axial": ("end", 0)}
    structure = linear_structure_from_fem(fem, "clamp", places)
    strain, turn = 1e-3, 2.0  # u_x = strain x, u_z = turn y^2
    field = np.column_stack([strain * basis.mesh.p[0], 0 * basis.mesh.p[0], turn * basis.mesh.p[1] ** 2])
    x = field[basis.mesh.p[0] > 0].ravel()
    assert structure.row("corner") @ x == pytest.approx(turn * 4e-4, rel=1e-13)
    assert structure.row("end") @ x == pytest.approx(turn * 1.5e-4, rel=1e-13)
    assert structure.row("axial") @ x == pytest.approx(strain * LENGTH, rel=1e-13)


def test_components_have_names_as_well(fem):
    structure = linear_structure_from_fem(fem, "clamp", {"named": (60, "uz"), "counted": (60, 2)})
    np.testing.assert_array_equal(structure.row("named"), structure.row("counted"))
    assert structure.dofs.rows[int(np.flatnonzero(structure.row("named"))[0])] == (60, "uz")


def test_it_strikes_a_stop_with_its_energy_kept(fem):
    structure = linear_structure_from_fem(fem, "clamp", {"end": ("end", 2)})
    model = MultiPhiModel(structure, [UnilateralContact("stop", "end", 1e-4, 1e6)], modes=8)
    start = model.static_equilibrium({"end": 500.0})
    run = simulate(model, 0.02, displacement=start)
    assert len(run.contact_intervals("stop")) >= 1
    assert abs(run.ledger.residual) < 1e-10 * run.ledger.initial


BAD = {
    "no such set": ({"fixed": "clmp"}, "fixed: got node set 'clmp', need one of: clamp, end; did you mean 'clamp'"),
    "no such node": ({"fixed": [10**6]}, "fixed: got 1000000, need 0 <= number < 63"),
    "no node": ({"fixed": [1.5]}, "fixed: got 1.5, need a number from 0 to 62"),
    "no nodes": ({"fixed": 3}, "fixed: got int, need node numbers"),
    "no such component": ({"points": {"tip": (0, 3)}}, r"points\['tip'\] component: got 3, need 0 <= number < 3"),
    "no pair": ({"points": {"tip": 3}}, r"points\['tip'\]: got 3, need \(node number"),
    "held": ({"fixed": "clamp", "points": {"tip": ("clamp", 0)}}, "which is fixed, need a point that can move"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_not_there_is_told_in_one_line(fem, case):
    given, message = BAD[case]
    with pytest.raises((MultiPhiValueError, MultiPhiTypeError), match=message):
        linear_structure_from_fem(fem, **given)


def test_a_model_without_matrices_or_of_another_size_is_refused(fem):
    with pytest.raises(MultiPhiTypeError, match="fem: got int, need an exudyn"):
        linear_structure_from_fem(3)
    with pytest.raises(MultiPhiValueError, match=r"fem: got nodes of the types \[\]"):
        linear_structure_from_fem(FEMinterface())
    fem.nodeSets[1]["NodeWeights"] = np.zeros(9)
    with pytest.raises(MultiPhiValueError, match=r"node set 'end': got weights .*, need 9 of sum > 0"):
        linear_structure_from_fem(fem, "clamp", {"tip": ("end", 0)})
    fem.nodes["Position"] = fem.nodes["Position"][1:]
    with pytest.raises(MultiPhiValueError, match=r"fem.massMatrix: got shape \(189, 189\), need \(186, 186\)"):
        linear_structure_from_fem(fem)
    fem.massMatrix = None
    with pytest.raises(MultiPhiTypeError, match=r"fem\.massMatrix: got NoneType"):
        linear_structure_from_fem(fem)

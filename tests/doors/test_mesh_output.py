"""Motions on meshes: the files open again, with the displacements and the forces of every node."""

import xml.etree.ElementTree as ElementTree

import meshio
import numpy as np
import pytest

from multiphi_exudyn import Friction, LinearStructure, MultiPhiError, MultiPhiModel, UnilateralContact, simulate
from multiphi_exudyn.time.mesh_output import contact_forces


@pytest.fixture
def run():
    """Four masses in a row, each with two directions, the first one held in both; pulled along the second direction."""
    stiffness = np.kron(2 * np.eye(4) - np.eye(4, k=1) - np.eye(4, k=-1), np.eye(2)) + np.diag([0.5] * 8)
    structure = LinearStructure(np.eye(8), stiffness, points={"end": 7, "middle": 4}, fixed=[0, 1])
    stop = UnilateralContact("stop", "end", 0.1, 5.0, friction=0.3, tangential="middle")
    rub = Friction("rub", "middle", 0.01)
    start = np.zeros(6)
    start[[2, 5]] = 0.3, 0.8
    return simulate(MultiPhiModel(structure, [stop, rub]), 6.0, displacement=start)


NODES = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]])
DOFS = np.arange(8).reshape(4, 2)


class TestFiles:
    @pytest.mark.parametrize("mesh", [NODES, meshio.Mesh(NODES, [("line", np.array([[0, 1], [1, 2], [2, 3]]))])])
    def test_open_with_what_the_trajectory_gives(self, run, tmp_path, mesh):
        times = np.array([0.0, 1.5, 4.0])
        collection, *files = run.to_vtu(tmp_path / "run.pvd", mesh, DOFS, times)
        listed = ElementTree.parse(collection).getroot().findall("Collection/DataSet")
        assert [float(each.get("timestep")) for each in listed] == times.tolist()
        assert [tmp_path / each.get("file") for each in listed] == files
        for file, t in zip(files, times, strict=True):
            read = meshio.read(file)
            x, v = run.displacement(t), run.velocity(t)
            np.testing.assert_allclose(read.point_data["displacement"][1:, :2], x.reshape(3, 2), atol=1e-13)
            np.testing.assert_allclose(read.point_data["velocity"][1:, :2], v.reshape(3, 2), atol=1e-13)
            assert not read.point_data["displacement"][0].any()
            force = read.point_data["contact force"]
            assert force[3, 1] == pytest.approx(run.contact_force("stop", t), abs=1e-12)
            friction = run.friction_force("stop", t) + run.friction_force("rub", t)
            assert force[2, 0] == pytest.approx(-friction, abs=1e-12)

    def test_forces_are_what_the_motion_lacks(self, run):
        structure = run.model.structure
        assert np.any(run.friction_force("stop", np.linspace(0.0, 6.0, 301)))
        for t in np.linspace(0.1, 5.9, 30).tolist():
            left = structure.mass @ run.acceleration(t) + structure.stiffness @ run.displacement(t)
            np.testing.assert_allclose(contact_forces(run, run.model, np.array([t]))[:, 0], left, atol=1e-11)


class TestPoints:
    def test_have_velocities_and_accelerations(self, run):
        times = np.linspace(0.1, 5.9, 7)
        row = np.array([0.0, 0.5, 0.0, 0.0, 0.0, -2.0])
        np.testing.assert_allclose(run.at(row, times, derivative=1), row @ run.velocity(times), atol=1e-13)
        np.testing.assert_allclose(run.at(row, times, derivative=2), row @ run.acceleration(times), atol=1e-12)
        assert run.at("end", 1.0, derivative=1) == pytest.approx(run.velocity(1.0)[5])

    def test_no_higher_derivative(self, run):
        with pytest.raises(MultiPhiError, match="derivative: got 3"):
            run.at("end", 0.0, derivative=3)


class TestRefusals:
    def test_name_what_is_needed(self, run, tmp_path):
        with pytest.raises(MultiPhiError, match=r"need a name that ends with \.pvd"):
            run.to_vtu(tmp_path / "run.vtu", NODES, DOFS)
        with pytest.raises(MultiPhiError, match=r"dofs: got shape \(3, 2\), need \(4, 1 to 3\)"):
            run.to_vtu(tmp_path / "run.pvd", NODES, DOFS[:3])
        with pytest.raises(MultiPhiError, match="whole numbers"):
            run.to_vtu(tmp_path / "run.pvd", NODES, DOFS * 1.0)
        with pytest.raises(MultiPhiError, match=r"mesh: got coordinates of shape \(4,\)"):
            run.to_vtu(tmp_path / "run.pvd", NODES[:, 0], DOFS)
        assert not list(tmp_path.iterdir())

"""A saved trajectory answers as the run did, from a file without pickled objects."""

import numpy as np
import pytest

import multiphi_exudyn as mp

TIMES = np.linspace(0.0, 0.2, 401)


@pytest.fixture(scope="module")
def run():
    """A beam that strikes a rubbing stop and a rigid one, with a friction ring, under a harmonic load."""
    piece = mp.Section.rectangle(0.0, 0.5, width=0.03, height=0.006, youngs_modulus=70e9, density=2700.0)
    beam = mp.Beam([piece], points={"ring": 0.2, "middle": 0.375, "tip": 0.5})
    structure = mp.planar_beam(beam, elements=6, damping=mp.RayleighDamping(beta=1e-5))
    contacts = [
        mp.UnilateralContact("stop", "middle", 1.35e-3, 1e6, friction=0.3, tangential="ring"),
        mp.UnilateralContact("above", {"tip": -1.0}, 2e-3, restitution=0.5),
        mp.Friction("ring", "ring", limit=0.5, stiffness=1e4),
    ]
    model = mp.MultiPhiModel(structure, contacts, modes="all")
    loads = [mp.HarmonicLoad("tip", 2.0, 11.0)]
    trajectory = mp.simulate(model, 0.2, velocity=0.3 * structure.row("tip"), loads=loads)
    assert {event.kind for event in trajectory.events} == {"close", "open", "stick", "slip"}
    return trajectory


@pytest.fixture(scope="module")
def saved(run, tmp_path_factory):
    path = tmp_path_factory.mktemp("saved") / "run.npz"
    run.save(path)
    return mp.load_trajectory(path)


QUESTIONS = {
    "displacement": lambda tr: tr.displacement(TIMES),
    "velocity from the left": lambda tr: tr.velocity(TIMES, side="left"),
    "acceleration": lambda tr: tr.acceleration(TIMES),
    "a point": lambda tr: tr.at("tip", TIMES),
    "a difference of points": lambda tr: tr.at({"tip": 1.0, "middle": -2.0}, TIMES),
    "a row": lambda tr: tr.at(np.arange(float(tr.displacement(0.0).size)), TIMES),
    "gap": lambda tr: tr.gap("above", TIMES),
    "contact force": lambda tr: tr.contact_force("stop", TIMES),
    "impulse": lambda tr: tr.contact_impulse("above", 0.0, 0.2),
    "impulse of a spring": lambda tr: tr.contact_impulse("stop", 0.01, 0.15),
    "friction force": lambda tr: tr.friction_force("ring", TIMES),
    "friction of a contact": lambda tr: tr.friction_force("stop", TIMES),
    "slip": lambda tr: tr.slip("ring", TIMES),
    "intervals": lambda tr: tr.contact_intervals("stop"),
    "sticking": lambda tr: tr.stick_intervals("ring"),
    "energy": lambda tr: tr.energy(TIMES),
    "table": lambda tr: tr.to_dataframe(times=TIMES).to_numpy(),
}


@pytest.mark.parametrize("question", QUESTIONS)
def test_it_answers_as_the_run_did(run, saved, question):
    expected, found = (np.asarray(QUESTIONS[question](tr)) for tr in (run, saved))
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-11 * np.max(np.abs(expected)))


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 cut short", b"no archive"])
def test_another_file_is_refused_by_name(tmp_path, content):
    path = tmp_path / "other.npz"
    path.write_bytes(content)
    with pytest.raises(mp.MultiPhiValueError, match=r"other\.npz.*Trajectory\.save"):
        mp.load_trajectory(path)


def test_a_picture_shades_when_contacts_are_closed(run, saved):
    for trajectory in (run, saved):
        above, below = trajectory.plot(points=["tip"]).axes
        closed = sum(len(trajectory.contact_intervals(name)) for name in trajectory.contacts)
        assert len(above.patches) == len(below.patches) == closed > 0
        assert [line.get_label() for line in above.lines] == ["tip"]
        assert (above.get_ylabel(), below.get_ylabel()) == ("displacement", "force")  # in the structure's units
        assert below.get_xlabel() == "time [s]; grey: stop closed, above closed"
        np.testing.assert_array_equal(
            below.lines[0].get_ydata(), trajectory.contact_force("stop", below.lines[0].get_xdata())
        )


def test_reprs_are_short(run, saved):
    model = run.model
    for thing in (
        run,
        saved,
        model,
        model.structure,
        model.level(()),
        run.ledger,
        run.segments[0],
        run.start,
        run.final,
    ):
        assert len(repr(thing)) < 300
        assert repr(thing).startswith(f"<{type(thing).__name__}: ")
        assert "<caption" in thing._repr_html_()

"""The front door refuses every bad value with one line that names the argument, what was given and what is needed."""

import math

import exudyn as exu
import numpy as np
import pytest
import scipy.sparse
from small_structures import chain, stop

import multiphi_exudyn as mp
from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody

N = 3
HUGE = 10**400  # an integer that no float can hold
NO_NUMBERS = {
    "nan": math.nan,
    "infinite": math.inf,
    "complex": 1j,
    "text": "1.0",
    "none": None,
    "object": object(),
    "function": len,
    "list": [1.0],
    "array": np.ones(2),
    "truth": True,
    "huge": HUGE,
    "dict": {"a": 1.0},
}


def bad_arrays(good):
    """A good array, spoiled in one way each: values, kinds and shapes."""
    good = np.asarray(good, float)
    spoiled = {name: good.copy() for name in ("nan", "infinite")}
    spoiled["nan"].flat[-1], spoiled["infinite"].flat[-1] = math.nan, -math.inf
    mixed = good.astype(object)
    mixed.flat[-1] = object()
    with_none = good.astype(object)
    with_none.flat[0] = None
    with_huge = good.astype(object)
    with_huge.flat[0] = HUGE
    return spoiled | {
        "complex": good + 0j,
        "text": good.astype(str),
        "objects": mixed,
        "a none": with_none,
        "huge": with_huge,
        "ragged": [[1.0], [1.0, 2.0]],
        "one more dimension": good[None, None],
        "one too many": np.ones(tuple(k + 1 for k in good.shape[:1]) + good.shape[1:]),
        "empty": np.zeros((0,) * good.ndim),
        "scalar": 1.0,
        "nothing but text": "abc",
        "dates": np.full(good.shape, "2020-01-01", "datetime64[D]"),
        "function": len,
    }


def structure(**given):
    return mp.LinearStructure(**({"mass": np.eye(N), "stiffness": 5 * np.eye(N), "points": {"tip": 0}} | given))


def model(**given):
    return mp.MultiPhiModel(**({"structure": structure(), "contacts": [stop("tip", 0.1)], "modes": "all"} | given))


def run(**given):
    return mp.simulate(**({"model": model(), "t_end": 0.1} | given))


def body(**given):
    return CreateMultiPhiBody(**({"mbs": exu.SystemContainer().AddSystem(), "model": model(), "name": "b"} | given))


def loaded(row):
    return run(loads=[mp.ConstantLoad(row, 1.0)])


ARRAYS = {
    "mass": (lambda a: structure(mass=a), np.eye(N)),
    "stiffness": (lambda a: structure(stiffness=a), np.eye(N)),
    "damping": (lambda a: structure(damping=a), np.eye(N)),
    "point": (lambda a: structure(points={"tip": a}), np.ones(N)),
    "direction": (lambda a: model(contacts=[mp.UnilateralContact("c", a, 0.1)]), np.ones(N)),
    "displacement": (lambda a: run(displacement=a), np.ones(N)),
    "velocity": (lambda a: run(velocity=a), np.ones(N)),
    "load row": (loaded, np.ones(N)),
    "gravity row": (lambda a: mp.Gravity(a).row(structure()), np.ones(N)),
    "body displacement": (lambda a: body(displacement=a), np.ones(N)),
    "body velocity": (lambda a: body(velocity=a), np.ones(N)),
    "sample times": (lambda a: mp.Sampled(a, np.ones(N)), np.arange(N)),
    "record values": (lambda a: mp.Accelerogram(np.arange(N), a), np.ones(N)),
    "sample values": (lambda a: mp.Sampled(np.arange(N), a), np.ones(N)),
    "load samples": (lambda a: mp.SampledLoad("tip", np.arange(N), a), np.ones(N)),
}
NUMBERS = {
    "gap": lambda x: mp.UnilateralContact("c", "tip", x),
    "stiffness": lambda x: mp.UnilateralContact("c", "tip", 0.1, x),
    "limit": lambda x: mp.Friction("f", "tip", x),
    "static limit": lambda x: mp.Friction("f", "tip", 0.1, x),
    "friction's spring": lambda x: mp.Friction("f", "tip", 0.1, stiffness=x),
    "surface speed": lambda x: mp.Friction("f", "tip", 0.1, velocity=x),
    "coefficient": lambda x: model(contacts=[mp.UnilateralContact("c", {"tip": x}, 0.1)]),
    "modes": lambda x: model(modes=x),
    "end": lambda x: run(t_end=x),
    "force": lambda x: mp.ConstantLoad("tip", x),
    "equilibrium force": lambda x: model().static_equilibrium({"tip": x}),
    "amplitude": lambda x: mp.Harmonic(x, 1.0),
    "frequency": lambda x: mp.Harmonic(1.0, x),
    "phase": lambda x: mp.Harmonic(1.0, 1.0, x),
    "load amplitude": lambda x: mp.HarmonicLoad("tip", x, 1.0),
    "sweep amplitude": lambda x: mp.Sweep(x, 1.0, 2.0, 1.0),
    "sweep start": lambda x: mp.Sweep(1.0, x, 2.0, 1.0),
    "sweep end": lambda x: mp.Sweep(1.0, 1.0, x, 1.0),
    "sweep duration": lambda x: mp.SweepLoad("tip", 1.0, 1.0, 2.0, x),
    "sweep tolerance": lambda x: mp.Sweep(1.0, 1.0, 2.0, 1.0, tolerance=x),
    "tolerance": lambda x: mp.Smooth(np.sin, x),
    "gravity": lambda x: mp.Gravity({"tip": 1.0}, x),
    "alpha": lambda x: mp.RayleighDamping(x, 0.0),
    "beyond": lambda x: mp.ModalDamping([0.1], x),
    "cut-off": lambda x: mp.UpTo(x),
    "most modes": lambda x: mp.UpTo(10.0, x),
    "error": lambda x: mp.Tolerance(x),
    "step": lambda x: body(matchedStepSize=x if x is not None else "none"),
    "time of a gap": lambda x: run().gap("c", x),
    "place on a beam": lambda x: mp.PointMass(x, 1.0),
    "mass on a beam": lambda x: mp.PointMass(0.0, x),
    "clamp": lambda x: mp.Clamp(x, -1.0 if isinstance(x, float) else 1.0),
    "section": lambda x: mp.Section.rectangle(x, 1.0, width=0.02, height=0.005, youngs_modulus=2e11, density=7800.0),
}
ALLOWED = {
    ("stiffness", "infinite"),  # rigid
    ("friction's spring", "infinite"),  # none
    ("static limit", "none"),  # the limit
    ("modes", "none"),  # chosen
    ("beyond", "none"),  # undamped, with a warning
    ("time of a gap", "array"),
    ("time of a gap", "list"),
    ("time of a gap", "truth"),
}
NO_NUMBER = NO_NUMBERS | {"negative": -1.0}
POSITIVE = (
    "stiffness",
    "limit",
    "static limit",
    "friction's spring",
    "modes",
    "end",
    "frequency",
    "sweep start",
    "sweep duration",
    "tolerance",
    "alpha",
    "cut-off",
)


def refusal(build, given):
    """The message with which ``given`` is refused."""
    with pytest.raises(mp.MultiPhiError) as caught:
        build(given)
    message = str(caught.value)
    assert isinstance(caught.value, (ValueError, TypeError))
    assert "\n" not in message
    assert ": " in message
    assert any(word in message for word in ("need", "asymmetric", "indefinite")), message
    return message


@pytest.mark.parametrize("argument", ARRAYS)
def test_an_array_with_a_bad_value_anywhere_is_refused(argument):
    build, good = ARRAYS[argument]
    build(good)
    for spoiled in bad_arrays(good).values():
        refusal(build, spoiled)


@pytest.mark.parametrize("kind", ["csr_array", "coo_matrix"])
@pytest.mark.parametrize("value", [math.nan, math.inf, 1j])
def test_a_bad_value_in_a_sparse_matrix_is_refused(kind, value):
    matrix = getattr(scipy.sparse, kind)(np.diag([1.0, 1.0, value]))
    for argument in ("mass", "stiffness", "damping"):
        assert refusal(lambda a, name=argument: structure(**{name: a}), matrix).startswith(f"{argument}: ")


@pytest.mark.parametrize("argument", NUMBERS)
def test_what_is_no_number_is_refused(argument):
    for name, given in NO_NUMBERS.items():
        if (argument, name) not in ALLOWED:
            refusal(NUMBERS[argument], given)


@pytest.mark.parametrize("argument", POSITIVE)
def test_what_is_negative_is_refused(argument):
    for value in (-1, -1e-300, -math.inf):
        refusal(NUMBERS[argument], value)


@pytest.mark.parametrize(
    ("build", "given"),
    [
        (lambda x: structure(points=x), None),
        (lambda x: structure(points={x: 0}), ""),
        (lambda x: structure(points={x: 0}), 3),
        (lambda x: structure(points={"a": x}), N),
        (lambda x: structure(points={"a": x}), -1),
        (lambda x: structure(points={"a": x}), True),
        (lambda x: structure(points={"a": x}), "0"),
        (lambda x: mp.ModalDamping(x), [0.1, "a"]),
        (lambda x: mp.ModalDamping(x), [[0.1]]),
        (lambda x: mp.ModalDamping(x), [math.nan]),
        (lambda x: mp.ModalDamping(x), None),
        (lambda x: mp.UnilateralContact(x, "tip", 0.1), ""),
        (lambda x: mp.UnilateralContact(x, "tip", 0.1), 3),
        (lambda x: model(structure=x), None),
        (lambda x: model(contacts=x), None),
        (lambda x: model(contacts=x), stop("tip")),
        (lambda x: model(contacts=x), ["stop"]),
        (lambda x: model(contacts=x), [stop("tip"), stop("tip")]),
        (lambda x: model(contacts=x), [stop("nowhere")]),
        (lambda x: model(contacts=x), [stop({})]),
        (lambda x: model(contacts=x), [stop({"tip": 0.0})]),
        (lambda x: model(contacts=x), [stop({3: 1.0})]),
        (lambda x: model(contacts=x), [stop(None)]),
        (lambda x: model(overrides=x), None),
        (lambda x: model(overrides=x), [()]),
        (lambda x: model(overrides=x), {("nowhere",): mp.LevelOverride([1.0])}),
        (lambda x: model(overrides=x), {"stop": mp.LevelOverride([1.0])}),
        (lambda x: model(overrides=x), {(): [1.0]}),
        (lambda x: mp.LevelOverride(x), "abc"),
        (lambda x: mp.LevelOverride(x), [[1.0]]),
        (lambda x: mp.LevelOverride(x), 3.0),
        (lambda x: mp.LevelOverride(None, x), ["a"]),
        (lambda x: model().level(x), "stop"),
        (lambda x: model().level(x), ("nowhere",)),
        (lambda x: model().level(x), None),
        (lambda x: model().static_equilibrium(x), None),
        (lambda x: model().static_equilibrium(x), {"nowhere": 1.0}),
        (lambda x: run(model=x), None),
        (lambda x: run(model=x), structure()),
        (lambda x: run(loads=x), None),
        (lambda x: run(loads=x), mp.ConstantLoad("tip", 1.0)),
        (lambda x: run(loads=x), [("tip", 1.0)]),
        (lambda x: run(loads=x), [mp.ConstantLoad("nowhere", 1.0)]),
        (lambda x: run(loads=x), [mp.ConstantLoad(None, 1.0)]),
        (lambda x: run().gap(x, 0.0), "nowhere"),
        (lambda x: run().at(x, 0.0), "nowhere"),
        (lambda x: run().displacement(0.0, x), "middle"),
        (lambda x: mp.truncation_indicator(x), None),
        (lambda x: mp.Sweep(1.0, 1.0, 2.0, 1.0, x), "cubic"),
        (lambda x: mp.Sweep(1.0, 1.0, 2.0, 1.0, x), None),
        (lambda x: mp.Sweep(1.0, 1.0, 2.0, 1.0, x), np.array(["linear", "linear"])),
        (lambda x: mp.Smooth(x), None),
        (lambda x: mp.Smooth(x), 3.0),
        (lambda x: mp.FunctionLoad("tip", x), "sin"),
        (lambda x: mp.StopMotion("c", x), None),
        (lambda x: mp.StopMotion("c", x), np.sin),
        (lambda x: mp.StopMotion(x, mp.Harmonic(1.0, 1.0)), None),
        (lambda x: mp.StopMotion(x, mp.Harmonic(1.0, 1.0)), ""),
        (lambda x: mp.BaseMotion("tip", x), mp.Sampled([0.0, 1.0], [0.0, 1.0])),
        (lambda x: mp.BaseMotion("tip", x), 3.0),
        (lambda x: mp.Accelerogram([0.0, 1.0], [0.0, 1.0], x), "g"),
        (lambda x: mp.Accelerogram([0.0, 1.0], [0.0, 1.0], x), math.nan),
        (lambda x: mp.Accelerogram([0.0, 1.0], x), [0.0]),
        (lambda x: mp.BaseMotion("tip", mp.Harmonic(1.0, 1.0), x), "stop"),
        (lambda x: mp.BaseMotion("tip", mp.Harmonic(1.0, 1.0), x), None),
        (lambda x: mp.BaseMotion("tip", mp.Harmonic(1.0, 1.0), x), [3]),
        (lambda x: mp.Gravity(x).row(structure()), None),
        (lambda x: mp.Gravity(x), "tip"),
        (lambda x: mp.Gravity(x).row(structure()), {"nowhere": 1.0}),
        (lambda x: mp.Sampled([0.0, 1.0], x), [1.0]),
        (lambda x: mp.Sampled([0.0], x), [1.0]),
        (lambda x: mp.Sampled(x, [0.0, 1.0]), [1.0, 1.0]),
        (lambda x: mp.Sampled(x, [0.0, 1.0]), [1.0, 0.0]),
        (lambda x: mp.planar_beam(x), None),
        (lambda x: mp.Beam(x), None),
        (lambda x: mp.Beam(x), []),
        (lambda x: mp.Beam(x), [3]),
        (lambda x: body(model=x), None),
        (lambda x: body(name=x), 3),
        (lambda x: body(mbs=x), None),
        (lambda x: body(loads=x), None),
    ],
)
def test_what_is_of_the_wrong_kind_is_refused(build, given):
    refusal(build, given)


def test_matrices_that_are_no_structure_are_refused():
    refusal(lambda m: structure(mass=m), [[1.0, 0.5], [0.4, 1.0]])
    refusal(lambda m: structure(mass=m), np.diag([1.0, 1.0, 0.0]))
    refusal(lambda m: structure(mass=m), np.ones((3, 3)))
    refusal(lambda m: structure(stiffness=m), np.diag([1.0, 1.0, -1.0]))
    refusal(
        lambda m: mp.MultiPhiModel(structure(stiffness=m), [], "all").level(()), [[1, 3, 0], [3, 1, 0], [0, 0, 1.0]]
    )
    refusal(lambda m: mp.simulate(chain(2), 1.0, m), np.zeros(2))

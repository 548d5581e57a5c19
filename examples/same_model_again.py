"""The same model again: another gap, another day, a record in g, and elements that are made of others.

    sweep     gaps without a new model: a stop that has moved by a constant changes only where a level comes to rest
    restart   a run that goes on from another one, which was kept in a file, as if it had not ended
    record    the ground's acceleration in g, of an earthquake say: displacements are relative to it
    damper    a one-way damper: a contact far inside its stop, with hardly any stiffness
    pressed   friction under a normal force that is given in time: a dummy mass, pressed on a rough stop

Each prints one number, by how much it differs from the same thing without the short cut.

Run: python examples/same_model_again.py
"""

from __future__ import annotations

import math
import pickle
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

import multiphi_exudyn as mp

G = 9.80665  # m/s2
T_END = 0.5  # s
GAPS = np.linspace(0.5e-3, 2.5e-3, 9)  # m
TIMES = np.linspace(0.0, T_END, 501)


def cantilever() -> mp.LinearStructure:
    """A beam of aluminium, clamped at 0."""
    piece = mp.Section.rectangle(0.0, 0.5, width=0.03, height=0.006, youngs_modulus=70e9, density=2700.0)
    beam = mp.Beam([piece], points={"middle": 0.375, "tip": 0.5})
    return mp.planar_beam(beam, elements=20, damping=mp.ModalDamping([0.01, 0.005], beyond=0.005))


def stopped(gap: float) -> mp.MultiPhiModel:
    """The beam with a stop under its middle."""
    return mp.MultiPhiModel(cantilever(), [mp.UnilateralContact("stop", "middle", gap, 1e6)], modes=12)


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    """||found - expected|| / ||expected||."""
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


def sweep() -> float:
    """Largest difference of the tip between a model of each gap and one model whose stop has been moved there.

    z(t) moves the stop towards the structure, so that the gap is that of the model less z. It is constant from before
    the start on. For a rigid stop, whose velocity may not jump, it is ``mp.Smooth``.
    """
    model = stopped(GAPS[0])
    pulled = model.static_equilibrium({"tip": 20.0})  # touches no stop
    apart, cost = 0.0, np.zeros(2)
    for gap in GAPS:
        started = time.process_time()
        own = mp.simulate(stopped(gap), T_END, displacement=pulled)
        between = time.process_time()
        moved = mp.StopMotion("stop", mp.Sampled([-1.0, T_END + 1.0], [GAPS[0] - gap] * 2))
        again = mp.simulate(model, T_END, displacement=pulled, loads=[moved])
        cost += between - started, time.process_time() - between
        apart = max(apart, relative(again.at("tip", TIMES), own.at("tip", TIMES)))
    print(f"sweep: {len(GAPS)} gaps, {cost[0] / cost[1]:.0f} times the cost with new models, {apart:.1e} apart")
    return apart


def restart() -> float:
    """Difference between a run and one in two parts, the first of which was kept in a file."""
    model = stopped(GAPS[0])
    pulled = model.static_equilibrium({"tip": 20.0})
    whole = mp.simulate(model, T_END, displacement=pulled)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.pickle"
        file.write_bytes(pickle.dumps(mp.simulate(model, T_END / 2, displacement=pulled)))
        first = pickle.loads(file.read_bytes())  # one's own files only: a pickle can run any program
    second = mp.simulate(first.model, T_END, start=first)
    later = TIMES[TIMES > T_END / 2]
    apart = relative(second.at("tip", later), whole.at("tip", later))
    print(f"restart: {len(second.events)} events after it, {apart:.1e} apart")
    return apart


def record() -> float:
    """Difference of the tip between a shaken base and the same as a record of its acceleration in g."""
    structure = cantilever()
    moves = np.zeros(structure.n)
    moves[::2] = 1.0  # e: every deflection moves with the base by 1, no rotation
    omega, shaken = 2 * math.pi * 12.0, mp.Harmonic(1e-3, 12.0)  # z(t) = 1 mm cos(omega t) of the base
    samples = np.linspace(0.0, T_END, 5001)
    in_g = -1e-3 * omega**2 * np.cos(omega * samples) / G  # z'' / g: what a record has
    ground = mp.BaseMotion(moves, mp.Accelerogram(samples, in_g, factor=G))
    model = mp.MultiPhiModel(structure, [mp.UnilateralContact("stop", "middle", 1e-3, 1e6)], modes=12)
    by_record = mp.simulate(model, T_END, loads=[ground])
    by_motion = mp.simulate(model, T_END, loads=[mp.BaseMotion(moves, shaken)])
    apart = relative(by_record.at("tip", TIMES), by_motion.at("tip", TIMES))
    print(f"record: up to {np.max(in_g):.2f} g, {len(by_record.events)} events, {apart:.1e} apart")
    return apart


def damper() -> float:
    """Difference between a damper that brakes motion towards it alone, and an integrator's.

    Its spring pushes with 1e-8 N, the product of stiffness and gap: a contact never pulls, so that the damper acts
    where its force is larger than that.
    """
    mass, stiffness, damping = 2.0, 800.0, 12.0  # kg, N/m, N s/m
    structure = mp.LinearStructure([[mass]], [[stiffness]], points={"x": 0})
    one_way = mp.UnilateralContact("damper", "x", gap=-1.0, stiffness=1e-8, damping=damping)
    run = mp.simulate(mp.MultiPhiModel(structure, [one_way]), 4.0, displacement=[0.01])
    times = np.linspace(0.0, 4.0, 401)

    def law(_: float, state: np.ndarray) -> list[float]:
        x, v = state
        return [v, (-stiffness * x + damping * max(0.0, -v)) / mass]

    expected = solve_ivp(law, (0.0, 4.0), [0.01, 0.0], t_eval=times, rtol=1e-11, atol=1e-14, max_step=1e-3).y[0]
    apart = relative(run.at("x", times), expected)
    print(f"damper: brakes {len(run.contact_intervals('damper'))} times, {apart:.1e} apart")
    return apart


def pressed() -> float:
    """Difference between friction under a normal force N(t), and mu N(t) as a load while it slides.

    The pad rests on a rigid stop, so that its contact force is the load on it, whatever its mass.
    """
    friction, constant, swing = 0.3, 20.0, 8.0  # mu; N(t) = 20 N + 8 N cos(2 pi 3 t)
    structure = mp.LinearStructure(np.diag([1.0, 1.0]), np.diag([100.0, 0.0]), points={"x": 0, "pad": 1})
    pad = mp.UnilateralContact("pad", "pad", gap=0.0, friction=friction, tangential="x")
    loads = [mp.ConstantLoad("pad", -constant), mp.HarmonicLoad("pad", -swing, 3.0)]
    run = mp.simulate(mp.MultiPhiModel(structure, [pad]), 2.0, velocity=[8.0, 0.0], loads=loads)
    turns = run.events[1].time  # after the pad has closed: the end of the first slip
    alone = mp.MultiPhiModel(mp.LinearStructure([[1.0]], [[100.0]], points={"x": 0}))
    brakes = [mp.ConstantLoad("x", -friction * constant), mp.HarmonicLoad("x", -friction * swing, 3.0)]
    slid = mp.simulate(alone, 2.0, velocity=[8.0], loads=brakes)
    times = np.linspace(0.0, turns, 101)
    apart = relative(run.at("x", times), slid.at("x", times))
    print(f"pressed: slides for {turns:.3f} s, takes {run.ledger.friction:.2f} J in all, {apart:.1e} apart")
    return apart


PARTS: tuple[Callable[[], float], ...] = (sweep, restart, record, damper, pressed)


def main() -> dict[str, float]:
    """Every part, and by how much it differs."""
    return {part.__name__: part() for part in PARTS}


if __name__ == "__main__":
    main()

"""Your own M and K: a chain of masses between two stops, one compliant, one rigid.

Run: python examples/own_matrices.py
"""

from __future__ import annotations

import numpy as np

import multiphi_exudyn as mp

MASS, STIFFNESS, COUNT = 0.5, 2.0e4, 12  # kg, N/m, number of masses; the first spring is fixed to the ground


def chain() -> mp.LinearStructure:
    """A chain of equal masses and springs, damped in proportion to its stiffness."""
    stiffness = STIFFNESS * (2 * np.eye(COUNT) - np.eye(COUNT, k=1) - np.eye(COUNT, k=-1))
    stiffness[-1, -1] = STIFFNESS
    return mp.LinearStructure(
        mass=MASS * np.eye(COUNT),
        stiffness=stiffness,
        damping=mp.RayleighDamping(beta=2e-5),
        points={"middle": COUNT // 2, "end": COUNT - 1},
    )


def main() -> mp.Trajectory:
    """Pull the end to +30 mm, let go, and look at what the stops do."""
    contacts = [
        mp.UnilateralContact("stop", direction="end", gap=5e-3),  # rigid, below the end
        mp.UnilateralContact("buffer", direction={"middle": -1.0}, gap=8e-3, stiffness=1e5),  # above the middle
    ]
    model = mp.MultiPhiModel(chain(), contacts)  # with all modes: there are few of them
    pulled = model.static_equilibrium({"end": 60.0})
    trajectory = mp.simulate(model, t_end=2.0, displacement=pulled)
    print(f"status {trajectory.status}; levels built: {trajectory.stats.levels_built} of 4")
    for name in ("stop", "buffer"):
        intervals = trajectory.contact_intervals(name)
        closed = sum(end - start for start, end in intervals)
        print(f"{name}: {len(intervals)} contact intervals, {closed * 1e3:.2f} ms closed in all")
    ledger = trajectory.ledger
    print(f"energy [J]: start {ledger.initial:.6f}, impacts {ledger.impact:.6f}, damping {ledger.damping:.6f}, ")
    print(f"  truncation {ledger.truncation_kinetic + ledger.truncation_strain:.6f}, end {ledger.final:.6f}, ")
    print(f"  unaccounted for {ledger.residual:.1e}")
    print("to distrust: " + ("; ".join(trajectory.warnings) or "nothing"))
    print(f"sensitivity horizon (1 %): {trajectory.horizon(0.01):.2f} s of {trajectory.t_end:.2f} s")
    return trajectory


if __name__ == "__main__":
    main()

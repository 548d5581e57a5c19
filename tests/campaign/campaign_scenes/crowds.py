"""Crowds: pipes that come to rest on racks, strings above beds of stops, bars that fall flat, laws of many knots.

What a few contacts with all modes never show: a truncated structure at rest on rigid stops, contacts that open or close
together by symmetry, dozens that strike in one instant, hundreds of segments that are passed in a moment. The answers
are sensitive: the law check judges them.
"""

import numpy as np

import multiphi_exudyn as mp
from campaign_scenes.parts import Scene

GRAVITY = 9.81  # m/s2


def _beam(elements, length, rigidity, mass):
    """M, K (2 (e + 1), 2 (e + 1)) of a free Euler beam, deflections at the even coordinates; mass per length."""
    h, n = length / elements, 2 * (elements + 1)
    k = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2]])
    k = np.vstack([k, -k[0], [6 * h, 2 * h**2, -6 * h, 4 * h**2]]) * rigidity / h**3
    m = np.array([[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2]])
    m = np.vstack([m, [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2]]) * mass * h / 420
    stiffness, masses = np.zeros((n, n)), np.zeros((n, n))
    for i in range(0, 2 * elements, 2):
        stiffness[i : i + 4, i : i + 4] += k
        masses[i : i + 4, i : i + 4] += m
    return masses, stiffness


def _racks(random):
    """A pipe, pinned at its ends, is lifted at one place and dropped on rigid racks, on which it comes to rest."""
    elements = int(random.choice([12, 16, 20, 24, 32]))
    mass, stiffness = _beam(elements, 6.0, 2.1e6, 30.0)
    kept = [i for i in range(len(mass)) if i not in (0, 2 * elements)]
    mass, stiffness = mass[np.ix_(kept, kept)], stiffness[np.ix_(kept, kept)]
    place = {j: kept.index(2 * j) for j in range(1, elements)}
    racks = int(random.integers(3, 7))
    if random.random() < 0.6:  # evenly, and as in a mirror
        half = [round(elements * (i + 1) / (racks + 1)) for i in range(racks)]
        at = sorted({*half, *(elements - j for j in half)})
    else:
        at = sorted(random.choice(np.arange(1, elements), racks, replace=False).tolist())
    lifted = elements // 2 if random.random() < 0.3 else int(random.integers(1, elements))
    lift = np.linalg.solve(stiffness, float(10.0 ** random.uniform(3.5, 4.8)) * np.eye(len(mass))[place[lifted]])
    weight = np.zeros(len(mass))
    weight[list(place.values())] = 1.0
    damping = mp.ModalDamping(float(random.choice([0.003, 0.01, 0.03])))
    structure = mp.LinearStructure(mass, stiffness, damping, {f"p{j}": i for j, i in place.items()})
    gap = float(random.choice([0.0, 0.0, 1e-3]))
    contacts = [mp.UnilateralContact(f"s{j}", f"p{j}", gap) for j in at]
    modes = [None, None, int(random.integers(racks + 2, 16))][int(random.integers(3))]
    model = mp.MultiPhiModel(structure, contacts, modes=modes)
    loads = (mp.ConstantLoad(mass @ weight, -GRAVITY),)
    return Scene("", 0, model, 0.4, lift, np.zeros(len(mass)), loads, None, by_laws=True)


def _strings(random):
    """A string is plucked above a bed of rigid stops that it touches in pairs; no damping, all modes or most."""
    count = int(random.integers(5, 33))
    modes = count - 1
    k = np.arange(1, modes + 1)
    pluck = 0.5 if random.random() < 0.7 else float(random.uniform(0.2, 0.8))
    shape = 8 / np.pi**2 / k**2 * np.sin(k * np.pi * pluck) / np.sqrt(2)
    rows = np.sqrt(2) * np.sin(np.pi * np.outer(k, np.arange(1, count)) / count)
    structure = mp.LinearStructure(
        np.eye(modes), np.diag((np.pi * k) ** 2), None, {f"p{j}": rows[:, j - 1] for j in range(1, count)}
    )
    gap = float(random.choice([0.0, 0.1, 0.2, 0.25, 0.3, 0.5, 0.55, random.uniform(0.02, 0.6)]))
    contacts = [mp.UnilateralContact(f"c{j}", f"p{j}", gap) for j in range(1, count)]
    kept = "all" if random.random() < 0.7 else max(3, modes * 3 // 4)
    model = mp.MultiPhiModel(structure, contacts, modes=kept)
    return Scene("", 0, model, 4.0, shape, np.zeros(modes), (), None, by_laws=True)


def _knots(random):
    """A chain of one to four masses with a force law of up to 400 knots, most of them in a narrow band."""
    n = int(random.integers(1, 5))
    springs = 10.0 ** random.uniform(0.5, 1.8, n)
    following = np.r_[springs[1:], 0.0]
    stiffness = np.diag(springs + following) - np.diag(springs[1:], 1) - np.diag(springs[1:], -1)
    mass = np.diag(random.uniform(0.5, 2.0, n))
    damping = mp.ModalDamping(0.01) if random.random() < 0.5 else None
    structure = mp.LinearStructure(mass, stiffness, damping, {f"m{i}": i for i in range(n)})
    band, count = float(10.0 ** random.uniform(-6, -1)), int(random.integers(30, 401))
    inner = band * np.linspace(-1, 1, count)
    knots = np.r_[-1.0, inner, 1.0]
    k, kind = (
        float(10.0 ** random.uniform(0, 2.5)),
        str(random.choice(["cubic", "dead zone", "tanh", "rough", "softening"])),
    )
    q = knots / band
    forces = {
        "cubic": k * band * (q + np.clip(q, -1, 1) ** 3),
        "dead zone": k * band * (q - np.clip(q, -0.5, 0.5)),
        "tanh": k * band * np.tanh(2 * q) + 0.1 * k * knots,
        "rough": np.r_[0.0, np.cumsum(10.0 ** random.uniform(-1, 1, count + 1) * k * np.diff(knots))],
        "softening": k * band * (q - 1.2 * np.clip(q, -1, 1) ** 3 / 3),
    }[kind]
    forces = forces - np.interp(0.0, knots, forces)
    law = mp.ForceLaw(f"m{n - 1}", (knots, forces), name="law")
    contacts = [mp.UnilateralContact("stop", "m0", float(random.uniform(0.02, 0.3)))] if random.random() < 0.3 else []
    modes = "all" if n == 1 or random.random() < 0.7 else n - 1
    model = mp.MultiPhiModel(structure, [*contacts, law], modes=modes)
    wave = float(random.uniform(0.1, 3.0)), float(random.uniform(0.1, 1.0))
    loads = (mp.HarmonicLoad("m0", *wave),) if random.random() < 0.5 else ()
    velocity = random.normal(size=n) * float(10.0 ** random.uniform(-2, 0))
    return Scene("", 0, model, float(random.uniform(2, 8)), np.zeros(n), velocity, loads, None, by_laws=True)


def _landings(random):
    """A free bar falls flat on a bed of 5 to 31 rigid stops, now and then a little tilted."""
    stops = 31 if random.random() < 0.05 else int(random.integers(5, 20))
    elements = stops - 1 if random.random() < 0.7 else stops + int(random.integers(0, 8))
    mass, stiffness = _beam(elements, 1.0, 100.0, 1.0)
    structure = mp.LinearStructure(mass, stiffness, None, {f"w{i}": 2 * i for i in range(elements + 1)})
    at = np.unique(np.round(np.linspace(0, elements, stops)).astype(int))
    contacts = [mp.UnilateralContact(f"s{i}", f"w{i}", 0.01) for i in at]
    down = np.zeros(len(mass))
    down[::2] = -1.0
    start = np.zeros(len(mass))
    tilt = float(random.choice([0.0, 0.0, 1e-12, 1e-6, 1e-3]))
    h = 1.0 / elements
    start[::2], start[1::2] = tilt * np.arange(elements + 1) * h, tilt
    modes = [8, 12, 20, "all", None][int(random.integers(5))]
    model = mp.MultiPhiModel(structure, contacts, modes=modes)
    return Scene("", 0, model, 0.12, start, np.zeros(len(mass)), (mp.Gravity(down, GRAVITY),), None, by_laws=True)


DRAWN = {"racks": _racks, "strings": _strings, "knots": _knots, "landings": _landings}

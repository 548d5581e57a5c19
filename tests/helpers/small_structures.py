"""Small structures with contacts, for the tests of the reduced model."""

import math

import numpy as np

from multiphi_exudyn import LinearStructure, ModalDamping, MultiPhiModel, RayleighDamping, UnilateralContact


def chain(n, *, damping=None, ends=1, mass=1.0, stiffness=1.0):
    """n masses on springs, the first held to the ground (``ends=0``: free); points m0, m1, ..."""
    matrix = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    matrix[-1, -1] = 1.0
    if ends == 0:
        matrix[0, 0] = 1.0 if n > 1 else 0.0
    return LinearStructure(mass * np.eye(n), stiffness * matrix, damping=damping, points={f"m{i}": i for i in range(n)})


def stop(at="m0", gap=1.0, stiffness=math.inf, name="stop"):
    return UnilateralContact(name, at, gap, stiffness)


def oscillator(gap=1.0, *, contact=math.inf, mass=2.0, stiffness=8.0, damping=None):
    """One mass on a spring, omega = 2 rad/s, over a stop."""
    structure = LinearStructure([[mass]], [[stiffness]], damping=damping, points={"m0": 0})
    return MultiPhiModel(structure, [stop(gap=gap, stiffness=contact)], modes="all")


def random_structure(seed, *, rigid_body=False):
    """A chain of 3 to 7 unequal masses and springs, a random damping of one of the four kinds."""
    random = np.random.default_rng(seed)
    n = int(random.integers(3, 8))
    springs = 10.0 ** random.uniform(0, 3, n)
    if rigid_body:
        springs[0] = 0.0
    following = np.r_[springs[1:], 0.0]
    stiffness = np.diag(springs + following) - np.diag(springs[1:], 1) - np.diag(springs[1:], -1)
    mass = np.diag(random.uniform(0.5, 2, n))
    root = random.normal(size=(n, n)) * 0.3
    damping = {
        "none": None,
        "modal": ModalDamping(random.uniform(0, 0.2, n)),
        "rayleigh": RayleighDamping(0.3, 1e-3),
        "given": root @ root.T,
    }
    return n, mass, stiffness, damping, random


def random_model(seed, *, damping="none", rigid_body=False, truncated=True, kind="mixed"):
    """A random structure with 1 to 3 contacts, among them stops above, below and between two masses."""
    n, mass, stiffness, dampings, random = random_structure(seed, rigid_body=rigid_body)
    points = {f"m{i}": i for i in range(n)}
    structure = LinearStructure(mass, stiffness, damping=dampings[damping], points=points)
    contacts, places = [], random.permutation(n)
    for i in range(int(random.integers(1, 4))):
        k = math.inf if kind == "rigid" else 10.0 ** random.uniform(1, 5)
        if kind == "mixed" and random.random() < 0.6:
            k = math.inf
        sign = float(random.choice([-1.0, 1.0]))
        at = {f"m{places[i]}": sign}
        if random.random() < 0.25 and i + 1 < n:
            at[f"m{places[(i + 1) % n]}"] = -sign
        contacts.append(UnilateralContact(f"c{i}", at, float(random.choice([0.0, 0.1, 0.5])), k))
    modes = int(random.integers(1, n - len(contacts) + 1)) if truncated and n > len(contacts) else "all"
    return MultiPhiModel(structure, contacts, modes=modes), random


def bed(stiffness, *, n=160, stops=40, modes=12, twins=False, apart=1e-10):
    """A bending chain, pinned at its ends, over a bed of stops; ``twins``: two, their stiffnesses so far ``apart``."""
    second = 2 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    bending = 1e8 * second @ second
    if twins:
        bending = np.kron(np.diag([1.0, 1 + apart]), bending)
    count = len(bending)
    places = np.linspace(2, count - 3, stops).astype(int)
    contacts = [UnilateralContact(f"c{i}", f"p{i}", 1e-3, stiffness) for i in range(stops)]
    structure = LinearStructure(np.eye(count), bending, points={f"p{i}": int(k) for i, k in enumerate(places)})
    return MultiPhiModel(structure, contacts, modes=modes)

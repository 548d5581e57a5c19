"""
The method: levels, transitions, the law of events, and runs from event to event.
"""

from collections.abc import Callable, Sequence
import enum
from typing import Annotated

import numpy
from numpy.typing import NDArray

import multiphi_exudyn.mathematics.exponentials


class Cause(enum.Enum):
    """Why a run ends before its time."""

    not_finite = 0

    search_too_long = 1

    chatter = 2

    not_admissible = 3

    squeezed = 4

    unsettled = 5

    mixed_restitution = 6

    gaining_energy = 7

    record_full = 8

    level_not_finite = 9

    indistinct_modes = 10

    cancelled_stiffness = 11

class Kind(enum.Enum):
    compliant = 0

    rigid = 1

    viscous = 2

    bounded = 3

    sliding = 4

class Rule(enum.Enum):
    """
    What happens to a guard whose signal is negative after changes of others.
    """

    may_recover = 0

    never_recovers = 1

    always_taken = 2

    taken_once = 3

    taken_falling = 4

class GuardForm:
    """shares: (link, gap, velocity, force), links among all links."""

    def __init__(self, *, target: int, rule: Rule, constant: float, shares: Sequence[tuple[int, float, float, float]], by_velocity: tuple[int, int, int] | None = None) -> None: ...

class ElementState:
    def __init__(self, *, guards: Sequence[GuardForm], links: Sequence[int], force: float, stretch: float, ratio: tuple[int, float] | None = None) -> None: ...

class Element:
    """knots: (first link, above, below); stick: (state, link, spring, drop)."""

    def __init__(self, *, kind: Kind, links: Sequence[int], states: Sequence[ElementState], stiffness: float, restitution: float, limit: float, static_limit: float, friction: float, static_friction: float, knots: tuple[int, int, int], stick: tuple[int, int, float, float]) -> None: ...

class Base:
    """The coordinates that all levels share, and the links in them."""

    def __init__(self, *, squares: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], rigid_body_modes: int, damping: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], directions: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], force_directions: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], stiffnesses: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], dampings: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], preload: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], energy_offset: float, held: Sequence[int], oblique: Sequence[int], residual: Sequence[int], general: bool, parallel: Sequence[int], points: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], names: Sequence[str], labels: Sequence[str]) -> None: ...

    def are_independent(self, rigid: Sequence[int]) -> bool: ...

    @property
    def orientation(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

def static_response(base: Base, closed: Sequence[int], gaps: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], load: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]]:
    """
    Forces (k,) of closed links and y (m,) in response to their gaps (k,) and a load (m,), without friction.
    """

class ModalLevel:
    """The modes of a set of closed links, without friction."""

    @property
    def links(self) -> tuple: ...

    @property
    def kept_beyond(self) -> int: ...

    @property
    def vibrates(self) -> bool: ...

    @property
    def squares(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def computed(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def shapes(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def inertial(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def damping(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def gaps(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def following(self) -> list[bool]: ...

    def static_shares(self, count: int) -> dict[int, float]:
        """
        By the first link of each spring, the share of its flexibility that modes beyond the first ones have.
        """

class MovingLevel:
    """The modes of a set of closed links, with friction of those that slide."""

    def __init__(self, base: Base, links: Sequence[int], kept: KeptModes) -> None: ...

    @property
    def modal(self) -> ModalLevel: ...

    @property
    def forces(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def force_rates(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def coupling(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def damping_matrix(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    def asymptotic(self, load: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], gaps: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]) -> Asymptotic: ...

    def deflection(self, load: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], gaps: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]]:
        """
        Forces (k,) of the closed links and y (m,) in response to a load (m,) and gaps (k,).
        """

class KeptModes:
    """Which modes levels keep: the lowest ones, up to a frequency [Hz]."""

    def __init__(self, most: int | None = None, highest: float = float('inf')) -> None: ...

class Asymptotic:
    """Static response of a level to gaps and a static load."""

    @property
    def configuration(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def gaps(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def forces(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def drive(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def load(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def strain(self) -> float: ...

    @property
    def potential(self) -> float: ...

class ResidualBoundary:
    """Residual contacts, and what their forces bend beside modes."""

    @property
    def flexibility(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def compliances(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

class ModalLevels:
    """The levels of a model, built on first use."""

    def __init__(self, base: Base, most: int | None, highest: float, measured: Sequence[tuple[Sequence[int], Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')] | None, Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')] | None]]) -> None:
        """
        most, highest: which modes levels keep. measured: frequencies [Hz] and damping ratios by closed links.
        """

    def level(self, links: Sequence[int]) -> MovingLevel: ...

    def boundary(self, host: Sequence[int]) -> ResidualBoundary: ...

    def set_most(self, most: int) -> None: ...

    @property
    def built(self) -> int: ...

    @property
    def count(self) -> int: ...

    @property
    def highest_frequency(self) -> float: ...

class Model:
    """The elements, and the levels that they have."""

    def __init__(self, *, levels: ModalLevels, gaps: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], elements: Sequence[Element], roughest_first: Sequence[int], is_complete: bool, knots: int) -> None: ...

    @property
    def size(self) -> int: ...

    @property
    def modes(self) -> int: ...

    @property
    def unit_directions(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def is_complete(self) -> bool: ...

class Excitation:
    """functions: (breaks, rates, coefficients) of the prescribed channels."""

    def __init__(self, *, static_load: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], patterns: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], stops: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], functions: Sequence[tuple[Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], Annotated[NDArray[numpy.complex128], dict(shape=(None,), order='C')], Annotated[NDArray[numpy.complex128], dict(shape=(None, None), order='C')]]], start: float, until: float, highest_frequency: float, is_isolated: bool, rate_of: Sequence[int], steady: int) -> None: ...

    @property
    def channels(self) -> int: ...

    @property
    def prescribed(self) -> int: ...

    @property
    def intervals(self) -> int: ...

    def interval_at(self, arg: float, /) -> int: ...

    def interval_start(self, arg: int, /) -> float: ...

    def interval_end(self, arg: int, /) -> float: ...

class Inputs:
    """The channels that are functions of time at an instant."""

    def __init__(self, excitation: Excitation) -> None: ...

    def set(self, interval: int, age: float, time: float, until: float) -> None: ...

    def advance(self, delay: float, time: float, until: float) -> None: ...

    @property
    def interval(self) -> int: ...

    @property
    def interval_end(self) -> float: ...

    @property
    def age(self) -> float: ...

    @property
    def horizon(self) -> float: ...

    @property
    def values(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def rates(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def accelerations(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def value_sizes(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def rate_sizes(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def acceleration_sizes(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def terms(self) -> list[tuple[complex, Annotated[NDArray[numpy.complex128], dict(shape=(None, None), order='C')]]]: ...

class Signal:
    """
    displacement.xi + velocity.xi' + constant, and its part of each exponential.
    """

    @property
    def displacement(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def velocity(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def constant(self) -> float: ...

    @property
    def depends_on_velocity(self) -> bool: ...

    @property
    def exponentials(self) -> Annotated[NDArray[numpy.complex128], dict(shape=(None,), order='C')]: ...

    @property
    def velocity_exponentials(self) -> Annotated[NDArray[numpy.complex128], dict(shape=(None,), order='C')]: ...

class VelocityTarget:
    @property
    def velocity(self) -> Signal: ...

    @property
    def forward(self) -> int: ...

    @property
    def backward(self) -> int: ...

class Guard:
    """A way out of the present state of an element."""

    @property
    def element(self) -> int: ...

    @property
    def target(self) -> int: ...

    @property
    def rule(self) -> Rule: ...

    @property
    def signal(self) -> Signal: ...

    @property
    def by_velocity(self) -> VelocityTarget | None: ...

class PotentialForm:
    @property
    def constant(self) -> float: ...

    @property
    def linear(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def squares(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def rows(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def follows(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

class Level:
    """The linear system that holds while every element keeps its state."""

    @property
    def key(self) -> tuple: ...

    @property
    def number(self) -> int: ...

    @property
    def modes(self) -> int: ...

    @property
    def channels(self) -> int: ...

    @property
    def prescribed(self) -> int: ...

    @property
    def omega(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def periods(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def highest_frequency(self) -> float: ...

    @property
    def links(self) -> tuple: ...

    @property
    def squares(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def computed(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def damping_matrix(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def damping(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def coupling(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def shapes(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def configuration(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def drive(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def static_drive(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def load(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def static_strain(self) -> float: ...

    @property
    def stored(self) -> float: ...

    @property
    def gap_rows(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def gap_constants(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def velocity_rows(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def force_rows(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def force_velocity_rows(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def forces(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def channel_force(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def channel_force_rate(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def channel_shapes(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def carried(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def response(self) -> ModalResponse: ...

    @property
    def displacement_acceleration(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def velocity_acceleration(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def constant_acceleration(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def drives_free_modes(self) -> bool: ...

    @property
    def guards(self) -> list[Guard]: ...

    def first_guard(self, element: int) -> int: ...

    def opening(self, element: int) -> Guard: ...

    @property
    def potential(self) -> PotentialForm: ...

    @property
    def patterns(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    def response_sizes(self, part: int) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def rates(self) -> Annotated[NDArray[numpy.complex128], dict(shape=(None,), order='C')]: ...

    def free_motion(self, displacement: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], velocity: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]) -> Annotated[NDArray[numpy.complex128], dict(shape=(None,), order='C')]:
        """Coefficients on the exponentials of the free motion from eta, eta'."""

    @property
    def size_factor(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def static_work(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def struck_defects(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def bytes(self) -> int: ...

class Transition:
    """A state expressed in the coordinates of the next level."""

    def __init__(self, source: Level, target: Level) -> None: ...

    @property
    def matrix(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def velocity_matrix(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def offset(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def terms(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')] | None: ...

    @property
    def start_sizes(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

class DefectForm:
    """Maps of (1, xi, s) and (xi', s') to what a level entered cannot hold."""

    def __init__(self, transition: Transition, stopped: Sequence[int]) -> None:
        """stopped: links along which an impact has left no velocity."""

    @property
    def displaced(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def moving(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

class Levels:
    """The levels of a model under its loads, built on first use."""

    def __init__(self, model: Model, excitation: Excitation, duration: float = float('inf')) -> None:
        """duration: of the longest motion [s]."""

    @property
    def model(self) -> Model: ...

    @property
    def base(self) -> Level: ...

    def level(self, states: Sequence[int]) -> Level: ...

    def transition(self, source: Level, target: Level) -> Transition: ...

    def entered_signal(self, level: Level, guard: int) -> Signal: ...

    def forget_but(self, kept: Level) -> None: ...

    @property
    def bytes(self) -> int: ...

class HeldLevels(Levels):
    """
    The levels of a model under constant forces that others hold for a step.
    """

    def __init__(self, model: Model, excitation: Excitation, duration: float = float('inf')) -> None: ...

    def set_forces(self, forces: Callable, inertia: tuple[Callable, Callable] | None = None) -> None:
        """
        forces: modal force and direct reactions by the states of a level. inertia: F by the states, and the map of velocities from one level to another.
        """

    def forget(self) -> None: ...

def energies(level: Level, displacement: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], velocity: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]) -> tuple[float, float, float, float]:
    """
    Kinetic and potential energy, potential of varying loads and strain energy [J] of xi, xi'.
    """

def losses(left: Level, displacement: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], velocity: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], entered: Level, displacement_after: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], velocity_after: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], collided: float) -> tuple[float, float, float, float, float, float]:
    """Energies [J] that a change of level takes."""

def clusters(squares: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]) -> list[tuple[int, int]]:
    """The first and one past the last of equal omega^2 (r,)."""

def cluster_end(squares: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], count: int) -> int | None:
    """
    The least number of modes >= count that parts no cluster; None where the last omega^2 are one.
    """

def aligned_modes(squares: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], modes: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], rows: Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)], sizes: Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)]) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]]:
    """
    omega^2 (r,), modes (r, m) and values of rows (k, r) with unique signs and bases of clusters.
    """

def jacobi_singular_values(matrix: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]]:
    """Singular values ascending (n,), right vectors (n, n)."""

def rank_one_modes(d: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], p: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], stiffness: float, count: int, most_steps: int = 100) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]] | None:
    """
    The lowest eigenvalues (count,) and vectors (count, m) of diag(d) + k p p^T; None if there are fewer.
    """

def without(directions: Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)], vectors: Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]:
    """The part of vectors (k, m) that is orthogonal to directions (d, m)."""

def largest_product_error(vectors: Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)]) -> float:
    """The largest element of |V V^T - I|, V (r, m)."""

def are_independent(directions: Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)], lengths: Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)], held: Sequence[int]) -> bool:
    """
    Whether the held ones of directions (l, m) of these lengths (l,) are linearly independent.
    """

def following(directions: Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)], lengths: Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)], held: Sequence[int]) -> list[bool]:
    """
    Which of directions (l, m) the held ones determine, and which are zero.
    """

class SmallProblem:
    """w = A x + b, x = G^T z, with low <= z <= high complementary to w."""

    def __init__(self, rows: Annotated[NDArray[numpy.float64], dict(shape=(None, None), writable=False)], values: Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)], sizes: Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)], lower: Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)], upper: Annotated[NDArray[numpy.float64], dict(shape=(None,), writable=False)], pushing_rows: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')] | None = None, leaders: Sequence[int] | None = None, ratios: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')] | None = None) -> None: ...

    class Side(enum.Enum):
        """Where a row is."""

        below = 0

        free = 1

        above = 2

        waiting = 3

    class Outcome(enum.Enum):
        """Whether a problem has a solution."""

        solved = 0

        excluded = 1

        undecided = 2

    class Order(enum.Enum):
        """Which of several violated rows is driven first."""

        most_violated = 0

        in_turn = 1

    def solve(self, order: SmallProblem.Order) -> SmallProblem.Outcome: ...

    def free_balanced_rows(self) -> None: ...

    @property
    def change(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def multipliers(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def sides(self) -> list[SmallProblem.Side]: ...

    @property
    def excluding(self) -> list[int]: ...

CUBIC_REMAINDER: float = 0.0026041666666666665

class SearchOutcome(enum.Enum):
    """What a search for the first descent finds."""

    none = 0

    found = 1

    not_finite = 2

    too_long = 3

class Search:
    """Search for the first descent of signals through zero, for tests."""

    def __init__(self, powers: Sequence[int], rates: Sequence[complex], unit: float, coefficients: Annotated[NDArray[numpy.complex128], dict(shape=(None, None), order='C', device='cpu', writable=False)], constants: Sequence[float], noises: Sequence[float], refinement: float) -> None: ...

    def first(self, start: float, horizon: float) -> tuple:
        """
        Outcome, signal, time [s], and if it is too long sample distance and remaining time [s].
        """

    def simultaneous(self, found: int, time: float) -> list[int]:
        """Signals that fall together."""

    def first_signs(self, sizes: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C', device='cpu', writable=False)], since: int) -> list[int]:
        """Signs just after t = 0."""

    @property
    def evaluations(self) -> int:
        """Samples taken in all searches so far."""

class Phase(enum.Enum):
    """What a guard waits for."""

    armed = 0

    recovering = 1

    refused = 2

    held_back = 3

    landing = 4

class Failure:
    """Why a run ended before its time."""

    @property
    def cause(self) -> Cause: ...

    @property
    def elements(self) -> list[int]: ...

    @property
    def details(self) -> list[float]: ...

class Start:
    """Initial conditions of a run in base coordinates."""

    def __init__(self, displacement: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], velocity: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], held: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], states: Sequence[int], spring_energy: float) -> None: ...

class FinalState:
    """Where a run ends, so that another one may go on from there."""

    def __init__(self, time: float, key: Sequence[int], displacement: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], velocity: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], phases: Sequence[Phase], interval: int = 0, age: float = 0.0) -> None: ...

    @property
    def time(self) -> float: ...

    @property
    def key(self) -> list[int]: ...

    @property
    def displacement(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def velocity(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def phases(self) -> list[Phase]: ...

    @property
    def interval(self) -> int: ...

    @property
    def age(self) -> float: ...

class StepState:
    """A state as the owner of held forces knows it, without them."""

    def __init__(self, key: Sequence[int], displacement: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], velocity: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], phases: Sequence[Phase]) -> None: ...

    @property
    def key(self) -> tuple: ...

    @property
    def displacement(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def velocity(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

    @property
    def phases(self) -> list[Phase]: ...

SHARED: int = -1

class Chatter:
    """The last decisions, among which chatter is looked for."""

class Works:
    """Works of damping, of varying loads and of friction [J]."""

    def __copy__(self) -> Works: ...

    def __getstate__(self) -> bytes: ...

    def __setstate__(self, arg: bytes, /) -> None: ...

    @property
    def damping(self) -> float: ...

    @property
    def varying(self) -> float: ...

    @property
    def friction(self) -> float: ...

class Ledger:
    """Entries of the energy ledger [J] up to the end of a trajectory."""

    def __copy__(self) -> Ledger: ...

    def __getstate__(self) -> bytes: ...

    def __setstate__(self, arg: bytes, /) -> None: ...

    @property
    def at_start(self) -> list[float]: ...

    @property
    def at_events(self) -> list[float]: ...

    @property
    def works(self) -> Works: ...

    @property
    def load_work(self) -> float: ...

    @property
    def start_energy(self) -> float: ...

    @property
    def start_potential(self) -> float: ...

    @start_potential.setter
    def start_potential(self, arg: float, /) -> None: ...

    @property
    def end_energy(self) -> float: ...

    @property
    def is_balanced(self) -> bool: ...

class Truncation:
    """What truncation did to a run; estimates are nan where not known."""

    def __copy__(self) -> Truncation: ...

    def __getstate__(self) -> bytes: ...

    def __setstate__(self, arg: bytes, /) -> None: ...

    @property
    def defects(self) -> float: ...

    @defects.setter
    def defects(self, arg: float, /) -> None: ...

    @property
    def truncated_energy(self) -> float: ...

    @property
    def start_square(self) -> float: ...

    @start_square.setter
    def start_square(self, arg: float, /) -> None: ...

    @property
    def mean_square(self) -> float: ...

    @mean_square.setter
    def mean_square(self, arg: float, /) -> None: ...

    @property
    def largest_energy(self) -> float: ...

    @largest_energy.setter
    def largest_energy(self, arg: float, /) -> None: ...

    @property
    def is_isolated(self) -> bool: ...

    @property
    def energy_share(self) -> float: ...

    @property
    def motion(self) -> float: ...

    def estimate(self, ledger: Ledger, threshold: float) -> None:
        """
        Set the estimates from the other numbers; threshold: of the indicator for a warning.
        """

def lost_share(lost: float, largest: float) -> float:
    """
    Share of energy lost in the largest energy of a run, zero where it is too small for a warning.
    """

def indicator(defects: float, mean_square: float) -> float:
    """Indicator of the motion of a sum of defects and the mean of |y|^2."""

IMMOVABLE: float = 1e-11

def is_balanced(ledger: Ledger, energy: float) -> bool:
    """
    Whether a ledger is closed and only takes energy; energy [J]: total of the last state, less static loads.
    """

OPEN_LEDGER: float = 1e-06

MOTION_THRESHOLD: float = 0.03

MOTION_SAMPLES: int = 17

class Trajectory:
    """The record of a run, segment by segment and event by event."""

    @property
    def keys(self) -> list[list[int]]:
        """states of the elements of every level visited"""

    @property
    def widths(self) -> list[int]: ...

    @property
    def instants(self) -> object: ...

    @property
    def levels(self) -> object: ...

    @property
    def intervals(self) -> object: ...

    @property
    def ages(self) -> object: ...

    @property
    def horizons(self) -> object: ...

    @property
    def entry_works(self) -> object: ...

    @property
    def armed_after(self) -> object: ...

    @property
    def all_armed(self) -> object: ...

    def start(self, segment: int) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]]:
        """xi, xi' at the start of a segment"""

    def start_phases(self, segment: int) -> list[Phase]:
        """phases of the guards at the start of a segment"""

    @property
    def event_times(self) -> object: ...

    @property
    def event_elements(self) -> object: ...

    @property
    def event_entered(self) -> object: ...

    @property
    def event_left(self) -> object: ...

    @property
    def event_impulses(self) -> object: ...

    @property
    def event_losses(self) -> object: ...

    @property
    def left_out(self) -> list[int]: ...

    @property
    def ledger(self) -> Ledger: ...

    @property
    def truncation(self) -> Truncation: ...

    @property
    def evaluations(self) -> int: ...

    @property
    def transitions(self) -> int: ...

    @property
    def memory(self) -> int: ...

    def __getstate__(self) -> tuple[list[list[int]], list[int], list[int], list[int], bytes, bytes, bytes, bytes, bytes, bytes, bytes, int, int]: ...

    def __setstate__(self, arg: tuple[Sequence[Sequence[int]], Sequence[int], Sequence[int], Sequence[int], bytes, bytes, bytes, bytes, bytes, bytes, bytes, int, int], /) -> None: ...

class Run:
    """A motion from event to event."""

    def __init__(self, levels: Levels, window: int, allowed: float, time: float = 0.0) -> None: ...

    def begin(self, start: Start) -> None: ...

    def go_on_from(self, state: FinalState, loads_differ: bool) -> None: ...

    def advance(self, end: float, stop_at_event: bool = False) -> Failure | None:
        """Advance to a time [s], or to the first event; a failure is returned."""

    @property
    def time(self) -> float: ...

    @property
    def has_started(self) -> bool: ...

    @property
    def final_state(self) -> FinalState | None: ...

    @property
    def trajectory(self) -> Trajectory: ...

    sums_works: bool

    keeps_summary: bool

    def begin_step(self, time: float, state: StepState) -> None:
        """Begin anew at a state; the record so far is dropped."""

    @property
    def present(self) -> StepState: ...

    @property
    def reached(self) -> StepState:
        """the state right before the last decision, or that at the end"""

    def limit_record(self, bytes: int) -> None: ...

    @property
    def defects(self) -> float:
        """their sum so far, which may begin anew"""

    @defects.setter
    def defects(self, arg: float, /) -> None: ...

    @property
    def chatter(self) -> Chatter: ...

    @chatter.setter
    def chatter(self, arg: Chatter, /) -> None: ...

    def set_attached(self, directions: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], independence: float, immovable: Sequence[int]) -> None: ...

class BatchRun:
    """A run of a batch; one that is not complete is to be run alone."""

    @property
    def trajectory(self) -> Trajectory: ...

    @property
    def final_state(self) -> FinalState | None: ...

    @property
    def is_complete(self) -> bool: ...

def run_batch(levels: Sequence[Levels], starts: Sequence[Start], window: int, allowed: float, time: float, end: float, threads: int) -> list[BatchRun]:
    """Many runs on several threads, each in its levels from its start."""

def solve_constrained(mass: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], jacobian: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], forces: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], prescribed: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]:
    """a and mu of M a + C^T mu = f, C a = g; redundant constraints share mu."""

class AttachedParts:
    """Masses and constraints attached to points of a body."""

    def __init__(self, mass: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], jacobian: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], first: int, own_mass: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], points: Sequence[int]) -> None: ...

    @property
    def acts_on_body(self) -> bool: ...

    @property
    def connected(self) -> list[int]: ...

    @property
    def inertia(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

    @property
    def free(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]: ...

class PointInertia:
    """Inertia attached to points of the structure."""

    def __init__(self, mass: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], free: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], in_base: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]) -> None: ...

    def impedance(self, rows: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]:
        """X (m, m) for rows (m, r) of the points."""

class SolverLevel:
    """A level as a solver integrates it, with the points of the body."""

    def __init__(self, *, equation: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], drive: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], rates: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], difference: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], velocity_inverse: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], physical: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], from_velocity: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], rows: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], offset: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], held_offset: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], reactions: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], push: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], rubbing: Sequence[int], rubbing_forces: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]) -> None: ...

class RepeatedStep:
    """Result of a step that has been computed again."""

    @property
    def state(self) -> StepState: ...

    @property
    def has_changed(self) -> bool: ...

    @property
    def largest_energy(self) -> float: ...

    @property
    def energy(self) -> float: ...

    @property
    def driven(self) -> int: ...

    @property
    def is_unresolved(self) -> bool: ...

    @property
    def event_time(self) -> float: ...

class CoupledStep:
    """Computes steps of another solver again, exactly."""

    def __init__(self, *, levels: HeldLevels, window: int, allowed: float, time: float, displacement: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu')], velocity: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu')], acceleration: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu')], multipliers: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu')], first: int, points: Sequence[int], ties: Sequence[int], in_base: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], has_varying_loads: bool, has_friction: bool, has_rigid: bool) -> None: ...

    def repeat(self, system: object, start: float, end: float, x_start: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], state: StepState, largest_energy: float, load_jumps: bool) -> RepeatedStep | Failure:
        """
        Compute the step again whose end the system has reached, and write its result; a failure is returned.
        """

    def take_events(self) -> list[tuple[float, int, int, int, float, list[float]]]:
        """
        Time, element, states entered and left, impulse and losses of new events.
        """

    @property
    def time(self) -> float: ...

    @property
    def key(self) -> tuple: ...

class Sampler:
    """Values of a recorded motion at any times."""

    def __init__(self, levels: Levels, trajectory: Trajectory) -> None: ...

    def values(self, times: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], from_left: bool, rows: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]:
        """
        row.(xi, xi', 1) at times [s]; rows (levels, 2 n + 1) by the level numbers of the trajectory
        """

    def states(self, segments: Annotated[NDArray[numpy.int32], dict(shape=(None,), order='C', device='cpu', writable=False)], after: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], width: int) -> Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]:
        """
        xi, then xi', (2 count, width) of segments, times [s] after their starts
        """

    def sizes(self, end: float) -> tuple[float, float]:
        """mean of |y|^2 and largest energy up to an end [s]"""

    def works(self, segments: Sequence[int]) -> Works: ...

    def closed_form(self, segment: int) -> tuple[Annotated[NDArray[numpy.complex128], dict(shape=(None,), order='C')], list[int], float, Annotated[NDArray[numpy.complex128], dict(shape=(None, None), order='C')], Annotated[NDArray[numpy.complex128], dict(shape=(None,), order='C')], int]:
        """
        rates, powers, unit, shapes (n, p), coefficients (p,), number of terms of the free response
        """

def split_steps(step: float, flow: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], rows: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], laws: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], record: Annotated[NDArray[numpy.float64], dict(shape=(None, None))]) -> None:
    """
    Fill a record (steps + 1, 2 r) of (z, z') from its first row on, by Strang splitting.
    """

class Chain:
    """
    Components y of a motion: y' = mixing y + pushes p, eta = ... + Re shapes y.
    """

    @property
    def mixing(self) -> Annotated[NDArray[numpy.complex128], dict(shape=(None, None), order='C')]: ...

    @property
    def shapes(self) -> Annotated[NDArray[numpy.complex128], dict(shape=(None, None), order='C')]: ...

    @property
    def pushes(self) -> Annotated[NDArray[numpy.complex128], dict(shape=(None, None), order='C')]: ...

class ModalResponse:
    """The free motion of modal equations in closed form."""

    @property
    def modes(self) -> int: ...

    @property
    def basis(self, /) -> multiphi_exudyn.mathematics.exponentials.Exponentials: ...

    @property
    def shapes(self) -> Annotated[NDArray[numpy.complex128], dict(shape=(None, None), order='C')]: ...

    @property
    def from_displacement(self) -> Annotated[NDArray[numpy.complex128], dict(shape=(None, None), order='C')]: ...

    @property
    def from_velocity(self) -> Annotated[NDArray[numpy.complex128], dict(shape=(None, None), order='C')]: ...

    @property
    def from_force(self) -> Annotated[NDArray[numpy.complex128], dict(shape=(None, None), order='C')]: ...

    @property
    def alone(self) -> Annotated[NDArray[numpy.bool_], dict(shape=(None,), order='C')]: ...

    @property
    def poles(self) -> Annotated[NDArray[numpy.bool_], dict(shape=(None,), order='C')]: ...

    @property
    def reached(self) -> list[tuple[int, int]]: ...

    @property
    def chains(self) -> list[Chain]: ...

    def coefficients(self, displacement: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], velocity: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], force: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')] | None = None) -> Annotated[NDArray[numpy.complex128], dict(shape=(None,), order='C')]:
        """
        Coefficients (p,) of the motion from eta, eta' (r,) under a modal force (r,).
        """

    def state(self, coefficients: Annotated[NDArray[numpy.complex128], dict(shape=(None,), order='C')], t: float) -> tuple[Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]]:
        """eta(t), eta'(t), both (r,)."""

def modal_response(squares: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], damping: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], coupling: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')] | None = None, duration: float = float('inf')) -> ModalResponse:
    """
    The closed form for omega^2 (r,), damping and coupling (r, r), of motions of at most that duration.
    """

def lightly_damped_response(squares: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], damping: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]) -> ModalResponse | None:
    """The closed form of modes that light damping couples; None for others."""

class ForcedResponse:
    """The response to a load that is a polynomial on a carrier."""

    def __init__(self) -> None: ...

    def compute(self, response: ModalResponse, rate: complex, forces: Annotated[NDArray[numpy.complex128], dict(shape=(None, None), order='C')], unit: float, displacement: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')] | None = None, velocity: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')] | None = None) -> Annotated[NDArray[numpy.complex128], dict(shape=(None, None), order='C')]:
        """x (rows, r) in powers of t / unit, beside a motion."""

def particular(response: ModalResponse, rate: complex, forces: Annotated[NDArray[numpy.complex128], dict(shape=(None, None), order='C')], unit: float) -> Annotated[NDArray[numpy.complex128], dict(shape=(None, None), order='C')]:
    """
    x (rows, r) in powers of t / unit, of the response to forces (degree + 1, r) on a carrier.
    """

class MotionParts:
    """Independent parts of a linear motion z' = A z."""

    @property
    def rates(self) -> Annotated[NDArray[numpy.complex128], dict(shape=(None,), order='C')]: ...

    @property
    def vectors(self) -> Annotated[NDArray[numpy.complex128], dict(shape=(None, None), order='C')]: ...

    @property
    def inverse(self) -> Annotated[NDArray[numpy.complex128], dict(shape=(None, None), order='C')]: ...

    @property
    def mixing(self) -> Annotated[NDArray[numpy.complex128], dict(shape=(None, None), order='C')]: ...

def motion_parts(system: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')]) -> MotionParts:
    """The parts of z' = A z."""

def works_of_segments(levels: Levels, trajectory: Trajectory, segments: Sequence[int]) -> Works:
    """
    Works [J] in segments of a trajectory, jumps at their starts included, each integrated.
    """

class StepConditions:
    """The rows that have to be exceeded in one level."""

    def __init__(self, *, rows: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], end_count: int, first_at_start: int, norm: Annotated[NDArray[numpy.float64], dict(shape=(None, None), order='C')], points: int, held: int, channels: int, has_point_forces: bool) -> None: ...

class StepTest:
    """Whether no event can have occurred within a step of a solver."""

    def __init__(self, conditions: StepConditions, step: float, rounding: float, displacement: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], velocity: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], acceleration: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], multipliers: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C', device='cpu', writable=False)], point_forces: Sequence[int]) -> None: ...

    def begin(self, time: float, x: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')], all_armed: bool) -> None: ...

    def set_end_channels(self, t: float, channels: Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]) -> None: ...

    def is_step_clear(self, t: float) -> bool: ...

    @property
    def time(self) -> float: ...

    @property
    def start(self) -> Annotated[NDArray[numpy.float64], dict(shape=(None,), order='C')]: ...

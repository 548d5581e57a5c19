"""Arrays: what the loop works on, in three flat buffers: ints (int64), numbers (float64), waves (complex128).

Offsets are ints. n = r + q coordinates xi = (eta, w) of a level of r modes and q channels, the prescribed ones first,
then places that links hold; p exponentials, c elements.

record    where                   what stands in it
--------  ----------------------  -------------------------------------------------------------------------------------
run       ints[0 ...]             sizes, where tables and scratch memory begin, states, counts, what is needed, causes
          numbers[0 ...]          times, energies lost, what a failure is told with
element   ints[ints[KINDS] + i]   COMPLIANT, RIGID, VISCOUS or SLIDING; chain, stiffness, direction (m,), and what
                                  friction does with its spring, in tables of their own
level     ints[level ...]         its key (c,), a small integer for every element; sizes; where its parts begin:
                                  motion (r, 2n + 1), eta'' = motion . (xi, xi', 1); gaps and gap velocities
                                  (c, n + 1); energies as forms in xi, xi'; its response (response_arrays.py) and exits;
                                  the power of damping xi'.D xi', of what varies (q, 4 n + 1), and of friction
                                  f.xi', as in work.py, or -1 without any, and a primitive of that of damping in the
                                  free response (2 r, 2 r), or -1, with its speeds and what of it works on w and w',
                                  (p, r + 2 q), and primitives of the powers of what channels force (work_forms.py);
                                  its mobility F (r, r) where others hang on the structure, else -1 (impact.py)
exit      ints[exit ...]          element, the state it asks for, whether it never recovers, its signal, and the signal
                                  that the element would have in the level entered alone, -1 while nobody needed it;
                                  the speed on which the state asked for hangs, and the others
signal    ints[signal ...]        s = row . (xi, xi', 1): where its row (2n + 1,) and the row times V begin, (2, p), or
                                  (p,) where it is not rated: no part of xi' is in it
map       ints[map ...]           xi_m = T xi_l + c, xi'_m = T' xi'_l + c' (eq. 38.6), channels included; where places
                                  are set, of which terms T and c are sums, (n_m, n_l + 1), else -1; where levels leave
                                  modes out, what a defect is read from (defect_sums.py), else -1
state     ints[state ...]         level, where xi, xi' and their scales stand, the phase of every exit
piece     ints[piece ...]         of the channels: Re sum_j exp(mu_j s) sum_d a_jd s^d, s = t - t_i: times, its terms
segment   SEGMENT_INTS            number of the level, piece, where coordinates and phases of its start stand
          INSTANTS                start, before the end of the last one
          COORDINATE_NUMBERS      of its start, see record.py
start     STARTS                  y, y' (m,), the places that links hold, the energy of springs among them
          START_STATES            a state for every element
event     EVENT_INTS              element, state entered (SHARED: an impulse on one that stays, before its event), left
          EVENT_NUMBERS           time, two losses to truncation
impact    IMPACT_INTS             which event it belongs to: those alone that have any of these are listed
          IMPACT_NUMBERS          impulse, losses by impact, stop work, damping, friction

A level is found by its key in a table, and so is a map by its two levels. Whatever is missing is asked for (NEED); what
an element is, and what friction will make of one (more states, more exits, channels that maps set), is data alone.
"""

from __future__ import annotations

import numpy as np

__all__ = ["Batch", "Buffers"]

# ---------------------------------------------------------------------- run record, ints

ELEMENTS, CHANNELS, COORDINATES, WHOLE = 0, 1, 2, 3
PRESCRIBED = 117  # channels that are functions of time, the first ones; transitions alone set the others, the held ones
KINDS, STIFFNESSES, DIRECTIONS = 4, 7, 8
SEGMENTS = 5  # of a force law the link of its first knot, and how many knots are above and below; zero of others
KNOTS = 6  # of all force laws
STICKS, HELD_LINKS, SPRINGS, DROPS = (
    113,
    114,
    115,
    116,
)  # of friction: sticking state, link, spring, what slip drops
LEVELS, LEVEL_SLOTS, MAPS, MAP_SLOTS = 9, 10, 11, 12  # tables by key
PIECES, PIECE_COUNT, PIECE, PIECE_NOW, TERMS_NOW, DRIVE_NEXT = (
    13,
    14,
    15,
    118,
    119,
    49,
)  # records of pieces, how many, the present one, its record; terms
NEEDED, NEEDED_FROM, NEEDED_KEY, GIVEN_UP = 16, 17, 18, 19  # what; of which level or exit; key; it cannot be had
CAUSE, CAUSED_BY = 20, 21  # of a failure; flags of elements that take part in it
TRANSITIONS, TRANSITIONS_NOW, CHANGED = 22, 23, 24  # in the run, in the decision under way; whether the last had events
CHANGES, CHANGE_IMPULSES, CHANGE_COUNT, CHANGE_ROOM = 25, 26, 27, 29  # of the decision under way: ints, numbers
FIRST_CHANGE = 72  # of the decision: those before it are impacts of the start
WINDOW, DECISIONS, RING = 28, 112, 30  # chatter: size of the window, decisions so far, where their ring begins
STOP_AT_EVENT, STARTING = 31, 71  # whether the run has still to begin: FRESH, from GIVEN, or GOING_ON, from CURRENT
SEGMENT_INTS, INSTANTS, SEGMENT_COUNT, SEGMENT_ROOM = 32, 33, 34, 35  # record
COORDINATE_NUMBERS, COORDINATE_COUNT = 36, 37
PHASE_INTS, PHASE_COUNT = 39, 40
EVENT_INTS, EVENT_NUMBERS, EVENT_COUNT, EVENT_ROOM = 42, 43, 44, 45
IMPACT_INTS, IMPACT_NUMBERS, IMPACT_COUNT = 46, 47, 48
LEFT_OUT, LEFT_OUT_COUNT = 38, 41  # segments of the record whose works are not summed

# scratch memory: where it begins
FLOW_BASIS, FLOW_FREE, FLOW_COUNT = 50, 51, 52  # its basis; exponentials of the free response, and of all
FLOW_RECORD, FLOW_WAVES, FLOW_FORCED, FLOW_TERMS, FLOW_FROM = 53, 54, 55, 56, 57  # FLOW_FROM: its state
FLOW_STATE, FORCES, FORCED, FORCED_WORK, FORCED_ROOM, FORCED_WANTED, SCALED_TERM = range(
    105, 112
)  # response to channels
WORK_NUMBERS = 227  # of sums of works: u at the start and at the end, their sum, their difference, means
SET_SIZES = 58  # of the terms of xi, xi' (2, n) after a map
DRIVE, DRIVE_WAVES = (
    59,
    60,
)  # w, w', w'' (3, q), of which terms they are the sums (3, q); terms of the piece now
SIGNALS, CONSTANTS, NOISES, WAITING, FALLEN, FOUND = 61, 62, 63, 64, 65, 66
SEARCH_NUMBERS, SEARCH_WAVES, WORK_WAVES = 67, 68, 69
ACCELERATION = 70
ROWS, VALUES, VALUE_SIZES, IMPULSES, FURTHER, MOVED, SMALL_PROBLEM, CHANGE = 73, 74, 75, 76, 77, 78, 79, 80
LOWEST, HIGHEST, LEADERS, RATIOS, WANTED = range(203, 208)  # of a small problem: its bounds; speeds wanted
RESTITUTIONS, LASTS, GROUPS = range(208, 211)  # of elements; who begins its last bounce; who is struck with whom
ASKING, AGAIN, HEARD, FREED, PENDING, PULLING, STRIKING, WISHES, SINGLES, DENIED = range(81, 91)  # sets
HELD, CLOSED, JOINED, UNION, KEY, COMPLIANT_KEY, TOUCHING, RESTING_LIST = range(91, 99)
JOIN_NUMBERS, PUSHED, RESTING_SIZES, ACCELERATION_TERMS, RELEASED_TERMS = range(100, 105)

JUDGED = 211  # whether levels leave modes out, so that defects are added up

# states, as records in the run record
CURRENT, REACHED, WORKED, ENTERED_STATE, RELEASED, STRUCK, STILL, AFTER = range(120, 184, 8)
GIVEN, SLOWED = range(184, 200, 8)  # at the start, in all modes: before and after its impact
LIMITS, STATIC_LIMITS = 200, 201  # of rigid friction, mu of contacts that give way and rub without a spring, else zero
TOGETHER = 202  # whether these have been decided together
FRICTIONS, STATIC_FRICTIONS = 212, 213  # of rigid contacts, zero of others
PUSHING, ENTERS = 214, 215  # along which rows those of a small problem push; the state in which a contact closes
COMPRESSED = 216  # a state, in all modes too: where an impact with friction and restitution has spent its first half
UNMOVED = 224  # flags of elements that nothing lets move: nobody looks at their exits
WORKING, SUMMED = 225, 226  # whether works are summed as segments end; whether those of the segment under way are
STARTS, START_STATES, START = 228, 229, 230  # where starts stand, their states in the ints; which of them a run has
MAPPED_AGAIN, SPEEDS_CHANGED = 231, 232  # whether the decision under way took more than one map; impacts beside it
ISOLATED = 233  # whether nothing works on the structure from outside
RUN_INTS = 234

# ---------------------------------------------------------------------- run record, numbers

TIME, HORIZON, LAST_DECISION, ALLOWED, INSTANT_TIME, AGE = 0, 1, 2, 3, 5, 6
SWUNG = 4  # twice the largest energy so far, as far as it was looked for
GIVEN_SPRINGS = 7  # strain energy [J] of the links that hold at the start, all in one
TOLD = 8  # three numbers of a failure
LOST, LOST_NOW, LOST_IN_IMPACT, LOST_STILLED = 12, 18, 24, 30  # energies of a decision, of an answer, of impacts
LOST_AT_START = 36  # from here to WORK: what a ledger is made of (time/balance.py)
LOST_SO_FAR = 42  # energies lost at events
WORK = 48  # [J] of varying loads and stops on the present state
GIVEN_ENERGY = 49  # kinetic and strain energy [J] that the run was given, less the potential of static loads
GIVEN_POTENTIAL = 50  # f.y [J] of static loads at the start
LEFT_ENERGY = 51  # kinetic and strain energy [J] of the state in which the loop was left, nan where that is not known
WORKS = 52  # [J] of damping, of what varies and of friction so far, in the segments that are not listed as left out
DEFECTS, TRUNCATED = 55, 56  # of the run: |defect|^2, nan where one is not known; energy truncated, without its sign
VERDICT = 57  # what truncation took, of the largest energy, and its indicator of the motion (time/verdict.py)
GIVEN_SQUARE = 59  # |y|^2 at the start, zero where a run goes on from another
LOOKED = 60  # instants of the motion looked at; of these the mean of |y|^2, and the largest energy (time/looking.py)
LOOK_FIRST, LOOK_END = 63, 64  # the first and the last such instant, one and the same where nobody looks on
INDEPENDENCE = 65  # of directions of length one: what is left beside others, below which one follows from them
WORKS_NOW = 66  # of the segment under way
SEEN = 69  # like LOOKED, with the segment under way; of samples of a run that is over (time/sampling.py)
RUN_NUMBERS = 72
OF_A_RUN = INDEPENDENCE  # so many, the first ones, are a run's own: it takes them along when another has the arrays
BY_IMPACT, KINETIC, STRAIN, STOP_WORK, DAMPING, FRICTION, LOSSES = 0, 1, 2, 3, 4, 5, 6

# ---------------------------------------------------------------------- other records, ints

COMPLIANT, RIGID, VISCOUS, SLIDING = 0, 1, 2, 3
FRESH, GOING_ON = 1, 2
OPEN, CLOSE = 0, 1  # states of a contact
STICK, SLIP_FORWARD, SLIP_BACKWARD, IDLE = 0, 1, 2, 3  # of friction, the last one of contacts that give way
ARMED, RECOVERING, REFUSED, HELD_BACK, LANDING = 0, 1, 2, 3, 4

NUMBER, MODES, STATES, RESPONSE, FORCE, EXITS, EXIT_COUNT, FIRST_EXITS = range(8)
FREQUENCIES, PERIODS, MOTION, GAPS, SPEEDS, POTENTIAL, CARRIED, PATTERNS, HIGHEST_FREQUENCY, MOBILITY = range(10, 20)
DISSIPATION, POWER, RUBBING = 20, 21, 22  # powers of damping, of what varies, of friction; zero while nobody asked
RUBBINGS = 23  # how many forces of friction go with others in the last of them
FOLLOWS, FOLLOW_COUNT = 24, 25  # rows (s, n + 1) of stretches that go with the force of a link, and their number
DISSIPATED = 26  # form in (eta, eta') of what damping takes from the free response, -1 where there is none
SWINGS = 27  # in the waves, of the free response: speeds, and what w, w' of what varies are multiplied by
FREE_SIZES = 8  # |A|, |B|, |P| (3, p, r) of its response, where channels are functions of time
STRUCK_DEFECTS = 9  # (c,) of rigid contacts that are struck in it and open again, per impulse squared, -1 for none
SIZES = 28  # triangular factor (n + 1, n + 1) of (Psi, R, y_inf), |y| = |factor (xi, 1)|, then the row (n + 1,) with
#             which static loads work on y; zero while nobody asked
DISSIPATED_MODES = 30  # (r, 2) of each mode in that form, first and one past the last that it goes with
DRIVEN = 29  # forms of the works of what channels force, -1 where there are none (work_forms.py)
STRAIN_FORM, STRAIN_ROWS = 31, 32  # strain energy: constant, row (n,), then rows (weight, n, offset), and how many of
#             these; zero while nobody asked
LEVEL_INTS = 33

ELEMENT, ASKED, FIRMNESS, SIGNAL, ENTERED = 0, 1, 2, 3, 6
TURN, FORWARD, BACKWARD = 7, 10, 11  # the speed that may turn it: a signal, -1 for none; the states asked for then
EXIT_INTS = 12
ROW, WAVE, RATED = 0, 1, 2

MATRIX, OFFSET, RATE_MATRIX, RATE_OFFSET, MAP_TERMS, MAP_DEFECT = 0, 1, 2, 3, 5, 6
MAP_SIZES = 4  # of a map from the base: of the terms that channels, w = 1, and a level's rest give modes, (r, q + 1)
MAP_ENTRY = 3  # ints of an entry of the table: from, to, map
LOOK_WIDTH = 3  # numbers of LOOKED, and of SEEN

LEVEL, PLACE, SPEED, REACH, MAPPED, SWING, PHASES, SETTLED = range(8)
STATE_INTS = 8

DRIVEN_COUNT, NODE_COUNT, CARRIER_COUNT = 0, 1, 2  # coefficients, nodes of a quadrature, carriers
DRIVEN_RESPONSE, CHANGING_DAMPING, CHANGING_VARYING, LASTING_DAMPING, LASTING_VARYING, NODES, WEIGHTS = range(3, 10)
CARRIERS, CARRIER_WIDTH = 10, 3  # of each its powers of time, where its rate stands in the waves, 2 for one not real
PIECE_TIMES, PIECE_TERMS, TERM_INTS = 0, 1, 2  # start and until in the numbers; of each term D + 1, where in waves
CHANGE_WIDTH = 3  # ints: element, state entered or SHARED, state left
SHARED = -1
SEGMENT_WIDTH = 4
DRIVEN_WIDTH = 3  # numbers of a start, after xi, xi', where channels are functions of time
EVENT_WIDTH, EVENT_WIDTH_NUMBERS, IMPACT_WIDTH = 3, 3, 5

# ---------------------------------------------------------------------- answers

OK, NEED, FAILED, FULL, END_REACHED, EVENT = 0, -11, -12, -13, 1, 2  # the negative ones below any sign
NEED_LEVEL, NEED_MAP, NEED_ENTERED, NEED_PIECES, NEED_ROOM, NEED_POWERS, NEED_SIZES = 1, 2, 3, 4, 5, 6, 7
NOT_FINITE, TOO_LONG, CHATTER, NOT_ADMISSIBLE, SQUEEZED, UNSETTLED, UNAVAILABLE, MIXED, GAINING = range(1, 10)


class Buffers:
    """The three buffers, which grow by doubling; whatever is put in them stays where it is."""

    def __init__(self) -> None:
        self.ints, self.numbers, self.waves = np.zeros(1024, np.int64), np.zeros(4096), np.zeros(4096, complex)
        self._used = {"ints": 0, "numbers": 0, "waves": 0}

    @property
    def all(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """ints, numbers, waves."""
        return self.ints, self.numbers, self.waves

    @property
    def size(self) -> int:
        """Bytes in use."""
        used = self._used
        return 8 * (used["ints"] + used["numbers"]) + 16 * used["waves"]

    def take(self, name: str, count: int) -> int:
        """Where so many zeros begin in the buffer ``name``."""
        start, buffer = self._used[name], getattr(self, name)
        self._used[name] = start + count
        if start + count > len(buffer):
            longer = np.zeros(max(2 * len(buffer), start + count), buffer.dtype)
            longer[:start] = buffer[:start]
            setattr(self, name, longer)
        return start

    def put(self, name: str, values: object) -> int:
        """Where these values begin in the buffer ``name``."""
        given = np.asarray(values).ravel()
        start = self.take(name, len(given))
        getattr(self, name)[start : start + len(given)] = given
        return start

    def used(self, name: str) -> int:
        """Where the next values will begin in the buffer ``name``."""
        return self._used[name]


class Batch:
    """Values that go into the buffers together; where each begins is known before. Nothing else is put meanwhile."""

    def __init__(self, buffers: Buffers) -> None:
        self.buffers = buffers
        self._parts: dict[str, list[np.ndarray]] = {"ints": [], "numbers": [], "waves": []}
        self._ends = {name: buffers.used(name) for name in self._parts}

    def put(self, name: str, values: object) -> int:
        """Where these values will begin in the buffer ``name``."""
        given, start = values if isinstance(values, np.ndarray) else np.array(values), self._ends[name]
        self._parts[name].append(given)
        self._ends[name] = start + given.size
        return start

    def write(self) -> None:
        """Put all of them in the buffers."""
        for name, parts in self._parts.items():
            if parts:
                start, end = self.buffers.used(name), self._ends[name]
                self.buffers.take(name, end - start)
                place = getattr(self.buffers, name)[start:end]
                np.concatenate(parts, axis=None, out=place, casting="unsafe")  # an empty list is one of floats

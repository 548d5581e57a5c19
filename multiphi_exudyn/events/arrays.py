"""Arrays that the loop works on, in three flat buffers: ints (int64), numbers (float64), waves (complex128).

Offsets are ints. n = r + q coordinates xi = (eta, w) of a level of r modes and q channels: first the prescribed ones,
then displacements that links hold; p exponentials, c elements.

record    where                   contents
--------  ----------------------  -------------------------------------------------------------------------------------
run       ints[0 ...]             sizes, offsets of tables and scratch memory, states, counts, what is needed, causes
          numbers[0 ...]          times, energies lost, numbers for the message of a failure
element   ints[ints[KINDS] + i]   COMPLIANT, RIGID, VISCOUS or SLIDING; its segments, stiffness, direction (m,), and the
                                  data of its friction, in tables of their own
level     ints[level ...]         its key (c,), a small integer for every element; sizes; offsets of its parts:
                                  motion (r, 2n + 1), eta'' = motion . (xi, xi', 1); gaps and gap velocities
                                  (c, n + 1); energies as forms in xi, xi'; its response (response_arrays.py) and exits;
                                  the powers of damping xi'.D xi', of varying loads (q, 4 n + 1), and of friction
                                  f.xi', as in work.py, or -1 without any; a primitive of that of damping in the
                                  free response (2 r, 2 r), or -1, with its velocities and the forces on w and w',
                                  (p, r + 2 q); primitives of the powers of forced responses (work_forms.py);
                                  its mobility F (r, r) if bodies are attached to the structure, else -1 (impact.py)
exit      ints[exit ...]          element, the state that it requests, its firmness (whether it may be refused, and may
                                  recover), its signal, and the signal that the element would have in the level entered
                                  alone, -1 until it is needed; the signal of the velocity on which the requested state
                                  depends, and the two states
signal    ints[signal ...]        s = row . (xi, xi', 1): offsets of its row (2n + 1,) and of row times V, (2, p), or
                                  (p,) if it is not rated: it does not depend on xi'
map       ints[map ...]           xi_m = T xi_l + c, xi'_m = T' xi'_l + c' (eq. 38.6), channels included; if it sets
                                  held displacements, the sizes of the terms of T and c, (n_m, n_l + 1), else -1; if
                                  levels leave modes out, the form of its defect (defect_sums.py), else -1
state     ints[state ...]         level, offsets of xi, xi', their scales, and the sizes of their terms in the map that
                                  has made them; the phase of every exit
piece     ints[piece ...]         of the channels: Re sum_j exp(mu_j s) sum_d a_jd s^d, s = t - t_i: times, its terms
segment   SEGMENT_INTS            number of the level, piece, offsets of coordinates and phases of its start
          INSTANTS                start, before the end of the last one
          COORDINATE_NUMBERS      of its start, see record.py
start     STARTS                  y, y' (m,), the displacements that links hold, the energy of their springs
          START_STATES            a state for every element
event     EVENT_INTS              element, state entered (SHARED: an impulse on one that stays, before its event), left
          EVENT_NUMBERS           time, two losses to truncation
impact    IMPACT_INTS             the event to which it belongs; only events with an impact have an entry
          IMPACT_NUMBERS          impulse, losses by impact, stop work, damping, friction

Levels are found by their keys in a table, and maps by their two levels. Missing entries are requested (NEED). The kind
of an element, and the states, exits and channels of its friction, are data alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from multiphi_exudyn.mathematics.compiling.compiled import Entry

__all__ = ["Buffers"]

# ---------------------------------------------------------------------- run record, ints

ELEMENTS, CHANNELS, COORDINATES, WHOLE = 0, 1, 2, 3
PRESCRIBED = 117  # channels that are functions of time, the first ones; held ones change at transitions only
KINDS, STIFFNESSES, DIRECTIONS = 4, 7, 8
SEGMENTS = 5  # of a force law the link of its first knot, and the numbers of knots above and below; else zero
KNOTS = 6  # of all force laws
STICKS, HELD_LINKS, SPRINGS, DROPS = (
    113,
    114,
    115,
    116,
)  # of friction: sticking state, link, spring, its drop at slip
LEVELS, LEVEL_SLOTS, MAPS, MAP_SLOTS = 9, 10, 11, 12  # tables by key
PIECES, PIECE_COUNT, PIECE, PIECE_NOW, TERMS_NOW, DRIVE_NEXT = (
    13,
    14,
    15,
    118,
    119,
    49,
)  # records of pieces, their number, the present one, its record; terms
NEEDED, NEEDED_FROM, NEEDED_KEY, GIVEN_UP = 16, 17, 18, 19  # kind; its level or exit; key; 1 if it cannot be built
CAUSE, CAUSED_BY = 20, 21  # of a failure; flags of elements involved
TRANSITIONS, TRANSITIONS_NOW, CHANGED = 22, 23, 24  # in the run, in this decision; whether the last one had events
CHANGES, CHANGE_IMPULSES, CHANGE_COUNT, CHANGE_ROOM = 25, 26, 27, 29  # of the present decision: ints, numbers
FIRST_CHANGE = 72  # of the decision: earlier ones are impacts at the start
WINDOW, DECISIONS, RING = 28, 112, 30  # chatter: size of the window, decisions so far, offset of their ring
STOP_AT_EVENT, STARTING = 31, 71  # of a run yet to begin: FRESH, from GIVEN, or GOING_ON, from CURRENT
SEGMENT_INTS, INSTANTS, SEGMENT_ROOM = 32, 33, 35  # record, in the order in which level_arrays.py lays it out
COORDINATE_NUMBERS, PHASE_INTS = 36, 39
EVENT_INTS, EVENT_NUMBERS, EVENT_ROOM = 42, 43, 45
IMPACT_INTS, IMPACT_NUMBERS = 46, 47
LEFT_OUT = 38  # segments of the record whose works are not summed

# scratch memory: offsets
FLOW_BASIS, FLOW_FREE, FLOW_COUNT = 50, 51, 52  # its basis; number of exponentials of the free response, and of all
FLOW_RECORD, FLOW_WAVES, FLOW_FORCED, FLOW_TERMS, FLOW_FROM = 53, 54, 55, 56, 57  # FLOW_FROM: its state
FLOW_STATE, FORCES, FORCED, FORCED_WORK, FORCED_ROOM, FORCED_WANTED, SCALED_TERM = range(
    105, 112
)  # response to channels
WORK_NUMBERS = 227  # of sums of works: u at the start and at the end, their sum, their difference, means
SET_SIZES = 58  # of the terms of xi, xi' (2, n) after a map
DRIVE, DRIVE_WAVES = (
    59,
    60,
)  # w, w', w'' (3, q), the sizes of their terms (3, q); terms of the present piece
SIGNALS, CONSTANTS, NOISES, WAITING, FALLEN, FOUND = 61, 62, 63, 64, 65, 66
SEARCH_NUMBERS, SEARCH_WAVES, WORK_WAVES = 67, 68, 69
ACCELERATION = 70
ROWS, VALUES, VALUE_SIZES, IMPULSES, FURTHER, MOVED, SMALL_PROBLEM, CHANGE = 73, 74, 75, 76, 77, 78, 79, 80
LOWEST, HIGHEST, LEADERS, RATIOS, WANTED = range(203, 208)  # of a small problem: its bounds; velocities to be reached
RESTITUTIONS, LASTS, GROUPS = range(208, 211)  # of elements; flags of last bounces that begin; groups struck together
# sets (c,) of elements. A requested state each, or NO_REQUEST (changes.py): ASKING all requests at an instant, PENDING
# of refused elements not treated yet, PULLING of exits that are always taken, WISHES targets under trial, SINGLES a
# copy. Flags: AGAIN refused at this instant before, HEARD treated at it, FREED reaction fallen to zero at it, STRIKING,
# DENIED.
ASKING, AGAIN, HEARD, FREED, PENDING, PULLING, STRIKING, WISHES, SINGLES, DENIED = range(81, 91)
# Flags of links: HELD before, CLOSED, JOINED, UNION of held and closing ones. KEY, COMPLIANT_KEY: keys of levels, the
# latter with all touching contacts open. TOUCHING, RESTING_LIST: lists of contacts that touch, and of elements at rest.
HELD, CLOSED, JOINED, UNION, KEY, COMPLIANT_KEY, TOUCHING, RESTING_LIST = range(91, 99)
JOIN_NUMBERS, PUSHED, RESTING_SIZES, ACCELERATION_TERMS, RELEASED_TERMS = range(100, 105)

JUDGED = 211  # whether levels leave modes out, so that defects are summed

# states, as records in the run record: CURRENT at the start of the present segment, REACHED at its end, before the
# decision, WORKED in a decision, ENTERED_STATE in a level under trial; in an impact RELEASED before it, all touching
# contacts open, STRUCK after it, STILL without negligible speeds, AFTER in the level of the contacts that stay closed
CURRENT, REACHED, WORKED, ENTERED_STATE, RELEASED, STRUCK, STILL, AFTER = range(120, 192, 9)
# in all modes: GIVEN and SLOWED before and after the impact at the start; COMPRESSED, in levels too, after a part of an
# impact: the compression of one with friction and restitution, a further one of contacts that are driven back
GIVEN, SLOWED, COMPRESSED = range(234, 261, 9)
LIMITS, STATIC_LIMITS = 200, 201  # of rigid friction; mu at compliant contacts without tangential spring; else zero
TOGETHER = 202  # whether friction at rest has been decided together at this instant
FRICTIONS, STATIC_FRICTIONS = 212, 213  # mu of rigid contacts, else zero
PUSHING, ENTERS = 214, 215  # rows of the impulses of a small problem; the state that a closing contact enters
ROUGHEST_FIRST = 216  # the elements by their friction at rigid contacts (c,): of redundant ones the first carries
UNMOVED = 224  # flags of elements that cannot move: their exits are not monitored
WORKING, SUMMED = 225, 226  # whether works are summed as segments end; whether those of the present segment are
STARTS, START_STATES, START = 228, 229, 230  # offsets of starts and of their states; the number of the run's start
MAPPED_AGAIN, SPEEDS_CHANGED = 231, 232  # whether the present decision used several maps, and impacts
ISOLATED = 233  # whether no load acts on the structure
SEGMENT_COUNT, COORDINATE_COUNT, PHASE_COUNT, EVENT_COUNT, LEFT_OUT_COUNT, IMPACT_COUNT = range(261, 267)  # record
COPY = 267  # what is where when the record is copied (time/record/loop_copies.py)
RUN_INTS = 284

RECORD_COUNTS, COUNTED = SEGMENT_COUNT, 6  # the first count of the record, and how many there are

# ---------------------------------------------------------------------- run record, numbers

TIME, HORIZON, LAST_DECISION, ALLOWED, INSTANT_TIME, AGE = 0, 1, 2, 3, 5, 6
SWUNG = 4  # twice the largest energy so far, at the instants sampled
GIVEN_SPRINGS = 7  # sum of the strain energies [J] of the links that hold at the start
TOLD = 8  # three numbers for the message of a failure
LOST, LOST_NOW, LOST_IN_IMPACT, LOST_STILLED = 12, 18, 24, 30  # energies of a decision, of an answer, of impacts
LOST_AT_START = 36  # from here to WORK: entries of the ledger (time/trajectory/ledger.py)
LOST_SO_FAR = 42  # energies lost at events
WORK = 48  # [J] of varying loads and stops up to the present state
GIVEN_ENERGY = 49  # kinetic and strain energy [J] at the start, less the potential of static loads
GIVEN_POTENTIAL = 50  # f.y [J] of static loads at the start
LEFT_ENERGY = 51  # kinetic and strain energy [J] of the last state of the loop, nan if not known
WORKS = 52  # [J] of damping, of varying loads and of friction so far, without the segments listed in LEFT_OUT
DEFECTS, TRUNCATED = 55, 56  # of the run: |defect|^2, nan if one is not known; energy truncated, absolute values
VERDICT = 57  # energy truncated over the largest energy, and its indicator for the motion (time/loop/verdict.py)
GIVEN_SQUARE = 59  # |y|^2 at the start, zero for a run that continues another
LOOKED = 60  # number of instants sampled; their mean of |y|^2, and the largest energy (time/loop/motion_size.py)
LOOK_FIRST, LOOK_END = 63, 64  # the first and the last such instant, equal if sampling has ended
BALANCED = 65  # whether the ledger is closed but for segments left out (time/loop/verdict.py)
INDEPENDENCE = 66  # of unit directions: if the part independent of others is shorter, a direction is redundant
WORKS_NOW = 67  # of the present segment
SEEN = 70  # like LOOKED, with the present segment; for samples of a finished run (time/record/sampling.py)
RUN_NUMBERS = 73
OF_A_RUN = INDEPENDENCE  # number of first entries that belong to a run: it copies them when another run uses the arrays
COPIED = OF_A_RUN + 1  # the same with its evaluations
BY_IMPACT, KINETIC, STRAIN, STOP_WORK, DAMPING, FRICTION, LOSSES = 0, 1, 2, 3, 4, 5, 6

# ---------------------------------------------------------------------- other records, ints

COMPLIANT, RIGID, VISCOUS, SLIDING = 0, 1, 2, 3
FRESH, GOING_ON = 1, 2
OPEN, CLOSE = 0, 1  # states of a contact
STICK, SLIP_FORWARD, SLIP_BACKWARD, IDLE = 0, 1, 2, 3  # of friction, the last one of contacts that are not rigid
ARMED, RECOVERING, REFUSED, HELD_BACK, LANDING = 0, 1, 2, 3, 4

NUMBER, MODES, STATES, RESPONSE, FORCE, EXITS, EXIT_COUNT, FIRST_EXITS = range(8)
FREQUENCIES, PERIODS, MOTION, GAPS, SPEEDS, POTENTIAL, CARRIED, PATTERNS, HIGHEST_FREQUENCY, MOBILITY = range(10, 20)
DISSIPATION, POWER, RUBBING = 20, 21, 22  # powers of damping, of varying loads, of friction; zero until they are needed
RUBBINGS = 23  # number of friction forces due to forces of links in the last of them
FOLLOWS, FOLLOW_COUNT = 24, 25  # rows (s, n + 1) of stretches proportional to the force of a link, and their number
DISSIPATED = 26  # form in (eta, eta') of the work of damping in the free response, -1 without
SWINGS = 27  # in the waves, of the free response: velocities, and the factors of w, w' in the power of varying loads
FREE_SIZES = 8  # |A|, |B|, |P| (3, p, r) of its response, if channels are functions of time
STRUCK_DEFECTS = 9  # (c,) of rigid contacts that are struck in it and open again, per squared impulse; zero until they
#             are needed, -1 where levels are not judged
SIZES = 28  # triangular factor (n + 1, n + 1) of (Psi, R, y_inf), |y| = |factor (xi, 1)|, then the row (n + 1,) with
#             which static loads work on y; zero until it is needed
DISSIPATED_MODES = 30  # (r, 2) of each mode in that form: the first mode coupled with it, and one past the last
DRIVEN = 29  # forms of the works of forced responses, -1 without (work_forms.py)
STRAIN_FORM, STRAIN_ROWS = 31, 32  # strain energy: constant, row (n,), then rows (weight, n, offset), and how many of
#             these; zero until it is needed
LEVEL_INTS = 33

ELEMENT, ASKED, FIRMNESS, SIGNAL, ENTERED = 0, 1, 2, 3, 6
TURN, FORWARD, BACKWARD = 7, 10, 11  # signal of the velocity that decides the state, -1 for none; the states
EXIT_INTS = 12
ROW, WAVE, RATED = 0, 1, 2

MATRIX, OFFSET, RATE_MATRIX, RATE_OFFSET, MAP_TERMS, MAP_DEFECT = 0, 1, 2, 3, 5, 6
MAP_SIZES = 4  # of a map from the base: of the terms due to channels, w = 1, and to the equilibrium, (r, q + 1)
MAP_ENTRY = 3  # ints of an entry of the table: from, to, map
LOOK_WIDTH = 3  # numbers of LOOKED, and of SEEN

LEVEL, PLACE, SPEED, REACH, MAPPED, MAPPED_SPEED, SWING, PHASES, SETTLED = range(9)
STATE_INTS = 9

DRIVEN_COUNT, NODE_COUNT, CARRIER_COUNT = 0, 1, 2  # coefficients, nodes of a quadrature, carriers
DRIVEN_RESPONSE, CHANGING_DAMPING, CHANGING_VARYING, LASTING_DAMPING, LASTING_VARYING, NODES, WEIGHTS = range(3, 10)
CARRIERS, CARRIER_WIDTH = 10, 3  # of each: powers of time, offset of its rate in the waves, 2 if not real, else 1
PIECE_TIMES, PIECE_TERMS, TERM_INTS = 0, 1, 2  # start, end in the numbers; of each term D + 1, offset in waves
CHANGE_WIDTH = 3  # ints: element, state entered or SHARED, state left
SHARED = -1
SEGMENT_WIDTH = 4
DRIVEN_WIDTH = 3  # numbers of a start, after xi, xi', if channels are functions of time
EVENT_WIDTH, EVENT_WIDTH_NUMBERS, IMPACT_WIDTH = 3, 3, 5

# ---------------------------------------------------------------------- return values

OK, NEED, FAILED, FULL, END_REACHED, EVENT = 0, -11, -12, -13, 1, 2  # the negative ones below any sign
NEED_LEVEL, NEED_MAP, NEED_ENTERED, NEED_PIECES, NEED_ROOM, NEED_POWERS, NEED_SIZES, NEED_STRUCK = range(1, 9)
NOT_FINITE, TOO_LONG, CHATTER, NOT_ADMISSIBLE, SQUEEZED, UNSETTLED, UNAVAILABLE, MIXED, GAINING = range(1, 10)


class Buffers:
    """The three buffers, which grow by doubling; values keep their offsets."""

    def __init__(self) -> None:
        self.ints, self.numbers, self.waves = np.zeros(1024, np.int64), np.zeros(4096), np.zeros(4096, complex)
        self._used = {"ints": 0, "numbers": 0, "waves": 0}
        self._bound: dict[Entry, Callable[..., Any]] = {}

    @property
    def all(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """ints, numbers, waves."""
        return self.ints, self.numbers, self.waves

    def bound(self, function: Entry) -> Callable[..., Any]:
        """Return a compiled function with the three buffers as its first arguments, until one of them grows."""
        bound = self._bound.get(function)
        if bound is None:
            bound = self._bound[function] = function.bound(*self.all)
        return bound

    @property
    def size(self) -> int:
        """Bytes in use."""
        used = self._used
        return 8 * (used["ints"] + used["numbers"]) + 16 * used["waves"]

    def take(self, name: str, count: int) -> int:
        """Reserve so many zeros in the buffer ``name``, and return their offset."""
        start, buffer = self._used[name], getattr(self, name)
        self._used[name] = start + count
        if start + count > len(buffer):
            longer = np.zeros(max(2 * len(buffer), start + count), buffer.dtype)
            longer[:start] = buffer[:start]
            setattr(self, name, longer)
            self._bound.clear()
        return start

    def put(self, name: str, values: object) -> int:
        """Append values to the buffer ``name``, and return their offset."""
        flat = np.asarray(values).ravel()
        start = self.take(name, len(flat))
        getattr(self, name)[start : start + len(flat)] = flat
        return start

"""Law of events: when an element changes its state, and which level follows. It is the same for every run and body.

Every contact has a function that says whether its present state is admissible, s >= 0:

    open                 s = g         gap
    closed, compliant    s = -g        penetration
    closed, rigid        s = lambda    reaction
    closed, viscous      s = lambda    force of spring and damper

With all modes the states exclude each other: where one stops being admissible the other begins to be. The truncated
bases of two levels need not agree, so the law says what happens then; each sentence with the functions that say it:

1. A contact is *armed* while s >= 0. When s falls through zero it asks to change state.
   -> phases.phase_of, monitoring.watch, monitoring.who_asks, decision.decide_jump
2. A rigid contact that asks to close is decided together with all rigid contacts that touch, in the basis of the
   level in which they are open: Moreau's impact, then complementarity of acceleration and reaction. A contact closes
   only if the level it enters gives it a reaction >= 0. At rest is also what would be back at its stop before its gap
   is more than round-off: so ends a sequence of ever smaller bounces. A contact whose gap the closed ones hold
   already stays open at its stop, without a force: of redundant contacts a set that is independent carries all.
   -> striking.impact, impact.collide, resting.list_resting, resting.press, resting.stay_closed, redundancy.join,
   striking.close_without_impact
3. A rigid contact that asks to open always opens: it never pulls. Friction that asks changes always, but stays in slip
   where it has come from stick at the same instant and truncation has left it a speed against its slip. With a spring
   that has fallen from its static limit it sticks again: its pressure may fall faster than its force.
   -> switching.is_firm, switching.open_and_enter, phases.is_pulled, sticking.let_go
4. A compliant contact that asks changes state unless s in the level it would enter is negative and falling. Of
   several that ask together and may not, the first that may alone changes.
   -> switching.try_wishes, switching.switch, phases.is_denied
5. A contact whose s is negative after a change (truncation) is *recovering*: it keeps its state while s rises, becomes
   armed when s reaches zero, and asks again if s turns down before.
   -> phases.phase_of, monitoring.watch
6. A contact that asked and may not change is *refused*: it keeps its state until s has risen to zero (then it is
   armed), or until s in the level it would enter has (then it changes). Where it then asks again at the same
   instant, for ever, it is *held back* until s has risen to zero, or until another contact asks.
   -> phases.update_phases, monitoring.watch, monitoring.flag_again, phases.hold_back
7. A viscous contact never pulls. It opens when its force falls to zero, mostly before its gap has risen to zero; then,
   open with g < 0, it is refused as in 6: armed when g has risen to zero, closed when its force in the level with it
   closed has. It may stay closed only with a force >= 0, and may open where its force would be negative.
   -> switching.is_relaxing
8. A force law asks at either end of its segment for the next one, and changes always. Where truncation has left it
   further beyond, for that in which it lies; it goes on from there, at the same instant, until it lies where it is, but
   not back to where it has just come from.
   -> changes.segment_at, changes.turn_wishes, switching.is_firm, decision.is_latest
9. A sign is that of the first derivative that is not round-off.
   -> signals.row_sign, signals.rate_sign, phases.becomes
10. A contact with friction that closes sticks where it hits; without a spring it slides in the direction in which it
   moves, and sticks where it does not. Whether it goes on sticking, or sliding, does not keep it from closing: what
   is always taken is decided after it, at the same instant. With a spring it sticks while its force, beyond the limit
   by truncation, comes back to it. Where its pressure falls to zero it opens, and keeps no friction.
   A rigid one that strikes has a tangential impulse of at most mu times the normal one, of all that touch at once,
   speed or none. What then slides pushes with its friction, what rests sticks up to its static friction. Who is at its
   stop begins in stick, and of redundant ones an independent set sticks.
   -> changes.turn_wishes, phases.is_denied, impact.rub, resting.sliding_level, rebounds.hear_touching
11. A rigid contact with restitution e that strikes leaves its stop with -e times its speed, and so do all that touch
   and are struck with it, in one impact (Moreau); those that are coupled have one e. Who is driven back to its stop is
   struck again at once. Where one of them rubs e is that of impulses: an impact without restitution, then one of at
   least e times its impulses (Poisson). A bounce too low to be seen is the last: it takes as long as all that would
   follow, and where it lands e is zero.
   -> rebounds.hear_touching, rebounds.rebound, rebounds.collide_and_rebound, rebounds.bounce, bounces.last_bounce,
   bounces.keep_landing
12. Rigid friction elements that stick, turn or begin to slip at an instant are decided together, those at contacts that
   give way with their mu N of the instant: their forces within their limits, static ones until they slip, are
   complementary to their accelerations. Of those that then fall from their static limits the ones that turn fall first:
   others may bear less after it, and stick on. What that leaves to the next derivative, and to truncation, each decides
   alone. Of redundant ones an independent set sticks, at last who bears the most beyond its limit; the others push with
   their limit, as if they slipped, or are idle at a contact that gives way, and take over when they are needed, also
   from one that only round-off keeps within its limit: the motion is the same where not more than one has a static
   limit. So do those along a closed rigid contact. One that would be pulled beside what sticks opens, and all is
   decided once more without it; also one beside which some fall that would pull it if they stuck, where without it all
   hold. None bears an impulse, nor does the friction of a contact that gives way.
   -> sticking.stick_together, sticking.decide_at_rest, friction_problem.sort_by_reserve, sticking.choose,
   sticking.thin_out_idle, sticking.let_go, sticking.hold_without, redundancy.thin_out, redundancy.follows,
   striking.slide_on, changes.bears_nothing, changes.without_stick

An instant is decided here: ``decide`` settles it, ``settle`` lets all be heard until nobody is refused who was not,
``answer`` gives those who ask to striking or to switching. All instants are roots of analytic signals, so nothing
depends on sampling. Negative gaps that truncation leaves are reported; an endless exchange is a failure, with a cause.

The decision works on the state WORKED, which begins as the one REACHED, and leaves that one as it was: where something
is missing (NEED) it is made again from the start.
"""

from __future__ import annotations

from multiphi_exudyn.events.arrays import (
    AFTER,
    AGAIN,
    ARMED,
    ASKED,
    ASKING,
    CAUSE,
    CAUSED_BY,
    CHANGE_COUNT,
    CHANGE_IMPULSES,
    CHANGE_ROOM,
    CHANGE_WIDTH,
    CHANGES,
    COMPLIANT_KEY,
    DENIED,
    ELEMENT,
    ELEMENTS,
    EVENT,
    EXIT_COUNT,
    EXIT_INTS,
    EXITS,
    FAILED,
    FIRMNESS,
    FIRST_CHANGE,
    FIRST_EXITS,
    FREED,
    FRICTION,
    HEARD,
    KINDS,
    KNOTS,
    LANDING,
    LEVEL,
    LOST,
    LOST_NOW,
    MAPPED_AGAIN,
    NOT_ADMISSIBLE,
    OK,
    OPEN,
    PENDING,
    PHASES,
    PULLING,
    REACHED,
    RECOVERING,
    REFUSED,
    RIGID,
    SHARED,
    SIGNAL,
    SPEEDS_CHANGED,
    STATES,
    STICKS,
    STRIKING,
    TOGETHER,
    TRANSITIONS_NOW,
    WORKED,
)
from multiphi_exudyn.events.law.bounces import keep_landing
from multiphi_exudyn.events.law.changes import NOBODY, bears_nothing, clear, enter, flag_asking, is_held, turn_wishes
from multiphi_exudyn.events.law.phases import hold_back, is_pulled, keep_entered, update_phases
from multiphi_exudyn.events.law.rebounds import forget_bounces, hear_touching
from multiphi_exudyn.events.law.sticking import stick_together
from multiphi_exudyn.events.law.striking import close_without_impact, impact
from multiphi_exudyn.events.law.switching import switch
from multiphi_exudyn.events.states.signals import row_sign
from multiphi_exudyn.events.states.state_arrays import clear_turning_speeds, copy_state, same_level
from multiphi_exudyn.mathematics.compiling.compiled import Ints, Numbers, Waves, compiled
from multiphi_exudyn.mechanics.element import ALWAYS_TAKEN, TAKEN_FALLING, TAKEN_ONCE

__all__ = ["ROUNDS", "decide", "decide_jump"]

MOST_RETURNS = 3  # changes of an element from or to a state at an instant, from which on it stays there
ROUNDS = 20  # of decisions at one instant: above it the contacts exclude each other's states for ever


@compiled
def decide(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """WORKED becomes the state right after an instant at which the elements in ASKING ask; OK, NEED or FAILED.

    AGAIN: those refused at it before. Energies lost are added up in LOST, changes listed. Where in the end all elements
    are as before, none was struck, no spring of friction has let go and none would pull, nothing has happened at it.
    """
    clear(numbers, LOST)
    first, struck = ints[FIRST_CHANGE], 0
    ints[CHANGE_COUNT] = first
    ints[TRANSITIONS_NOW] = 0
    ints[MAPPED_AGAIN] = 0
    ints[SPEEDS_CHANGED] = 0
    copy_state(ints, numbers, REACHED, WORKED)
    forget_bounces(ints)
    ints[TOGETHER] = 0
    clear_turning_speeds(ints, numbers, WORKED)
    status = settle(ints, numbers, waves)
    if status < 0:
        return status
    for k in range(first, ints[CHANGE_COUNT]):
        shared = ints[ints[CHANGES] + k * CHANGE_WIDTH + 1] == SHARED
        if shared or numbers[ints[CHANGE_IMPULSES] + k] != 0.0:
            struck = 1
    moved = struck == 1 or numbers[LOST + FRICTION] != 0.0 or same_level(ints, REACHED, WORKED) == 0
    if ints[CHANGE_COUNT] > first and not moved and is_pulled(ints, numbers, waves, REACHED) == 0:
        copy_state(ints, numbers, REACHED, WORKED)
        flag_asking(ints, ints[ASKING], ints[DENIED])
        update_phases(ints, numbers, waves, WORKED, ints[DENIED])
        hold_back(ints, WORKED)
        clear(numbers, LOST)
        ints[CHANGE_COUNT] = first
    keep_landing(ints, numbers)
    return OK


@compiled
def decide_jump(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """1. The decision after channels have jumped: OK where nobody asks, EVENT where somebody does; NEED or FAILED."""
    exits, asking = ints[ints[REACHED + LEVEL] + EXITS], 0
    for i in range(ints[ELEMENTS]):
        ints[ints[ASKING] + i] = NOBODY
        ints[ints[AGAIN] + i] = 0
    for k in range(ints[ints[REACHED + LEVEL] + EXIT_COUNT]):
        exit_ = exits + k * EXIT_INTS
        waits = ints[ints[REACHED + PHASES] + k] in (ARMED, LANDING)
        if waits and row_sign(ints, numbers, REACHED, exit_ + SIGNAL, 0.0) < 0:
            ints[ints[ASKING] + ints[exit_ + ELEMENT]] = ints[exit_ + ASKED]
            asking = 1
    ints[CHANGE_COUNT] = 0
    if asking == 0:
        return OK
    status = decide(ints, numbers, waves)
    return status if status < 0 else EVENT


@compiled
def settle(ints: Ints, numbers: Numbers, waves: Waves) -> int:
    """Decisions at one instant until nobody is refused who has not been heard; OK, NEED or FAILED."""
    c, asking, heard, freed, pending = ints[ELEMENTS], ints[ASKING], ints[HEARD], ints[FREED], ints[PENDING]
    flag_asking(ints, asking, heard)
    asked = 0
    for i in range(c):
        ints[freed + i] = is_held(ints, WORKED, i) if ints[asking + i] == OPEN else 0
        asked += ints[heard + i]
    if asked > 0:
        status = answer(ints, numbers, waves, asking)
        if status < 0:
            return status
    else:
        update_phases(ints, numbers, waves, WORKED, -1)
    for _ in range(ROUNDS + c + ints[KNOTS]):
        keep_entered(ints, numbers)
        left = find_refused(ints)
        if left == 0:
            return OK
        if ints[CHANGE_COUNT] + 3 * c > ints[CHANGE_ROOM]:
            break
        status = OK
        if left == 1:
            for i in range(c):
                if ints[pending + i] != NOBODY:
                    ints[heard + i] = 1
                    if ints[pending + i] == OPEN and is_held(ints, WORKED, i) == 1:
                        ints[freed + i] = 1
            status = answer(ints, numbers, waves, pending)
        elif left == 2:  # heard before: what others did at this instant took its reaction away
            status = switch(ints, numbers, waves, ints[PULLING])
        else:
            hold_back(ints, WORKED)
            return OK
        if status < 0:
            return status
    ints[CAUSE] = NOT_ADMISSIBLE
    flag_asking(ints, pending, ints[CAUSED_BY])
    return FAILED


@compiled
def find_refused(ints: Ints) -> int:
    """0: no exit of WORKED is refused; 1: those of elements not heard yet, PENDING; 2: some always taken, PULLING.

    3: of others only. Who has changed has been heard. What is taken once is taken where another has changed since, and
    does not wait where the instant itself, an impact, has turned it.
    """
    level, heard, pending, pulling = ints[WORKED + LEVEL], ints[HEARD], ints[PENDING], ints[PULLING]
    for k in range(ints[FIRST_CHANGE], ints[CHANGE_COUNT]):
        if ints[ints[CHANGES] + k * CHANGE_WIDTH + 1] != SHARED:
            ints[heard + ints[ints[CHANGES] + k * CHANGE_WIDTH]] = 1
    for i in range(ints[ELEMENTS]):
        ints[pending + i] = NOBODY
        ints[pulling + i] = NOBODY
    refused, unheard, pulled = 0, 0, 0
    for k in range(ints[level + EXIT_COUNT]):
        exit_ = ints[level + EXITS] + k * EXIT_INTS
        element = ints[exit_ + ELEMENT]
        if ints[ints[WORKED + PHASES] + k] == REFUSED or is_turned(ints, k) == 1:
            refused = 1
            if ints[heard + element] == 0:
                ints[pending + element] = ints[exit_ + ASKED]
                unheard = 1
            once = ints[exit_ + FIRMNESS] == TAKEN_ONCE and is_latest(ints, element, ints[exit_ + ASKED]) == 0
            if ints[exit_ + FIRMNESS] == ALWAYS_TAKEN or ints[exit_ + FIRMNESS] == TAKEN_FALLING or once:
                ints[pulling + element] = ints[exit_ + ASKED]
                pulled = 1
    if refused == 0:
        return 0
    if unheard == 1:
        return 1
    return 2 if pulled == 1 else 3


@compiled
def is_turned(ints: Ints, exit_number: int) -> int:
    """1 where what is taken once waits in WORKED, and was armed in the same state of its element before the instant."""
    level, before = ints[WORKED + LEVEL], ints[REACHED + LEVEL]
    exit_ = ints[level + EXITS] + exit_number * EXIT_INTS
    element = ints[exit_ + ELEMENT]
    waits = ints[ints[WORKED + PHASES] + exit_number] == RECOVERING and ints[exit_ + FIRMNESS] == TAKEN_ONCE
    if not waits or ints[ints[before + STATES] + element] != ints[ints[level + STATES] + element]:
        return 0
    k = ints[ints[before + FIRST_EXITS] + element] + exit_number - ints[ints[level + FIRST_EXITS] + element]
    return 1 if ints[ints[REACHED + PHASES] + k] == ARMED and is_latest(ints, element, ints[exit_ + ASKED]) == 0 else 0


@compiled
def is_latest(ints: Ints, element: int, asked: int) -> int:
    """8. 1 where an element was the last to change at this instant, from the state asked for, or has changed often."""
    last, left, count = NOBODY, NOBODY, 0
    for k in range(ints[FIRST_CHANGE], ints[CHANGE_COUNT]):
        last = ints[ints[CHANGES] + k * CHANGE_WIDTH]
        left = ints[ints[CHANGES] + k * CHANGE_WIDTH + 2]
        touched = left == asked or ints[ints[CHANGES] + k * CHANGE_WIDTH + 1] == asked
        count += 1 if last == element and touched else 0
    return 1 if (last == element and left == asked) or count > MOST_RETURNS else 0


@compiled
def answer(ints: Ints, numbers: Numbers, waves: Waves, asking: int) -> int:
    """WORKED with its phases after those in ``asking`` (c,) have been heard; OK, NEED or FAILED.

    HEARD: all that touch at this instant. FREED: those of them whose reaction has fallen to zero at it.
    """
    c, striking, states = ints[ELEMENTS], ints[STRIKING], ints[ints[WORKED + LEVEL] + STATES]
    turn_wishes(ints, numbers, asking)
    strikes, before = 0, ints[CHANGE_COUNT]
    clear(numbers, LOST_NOW)
    hear_touching(ints, numbers, asking)
    for i in range(c):
        rigid = ints[ints[KINDS] + i] == RIGID
        ints[striking + i] = 1 if rigid and ints[ints[HEARD] + i] == 1 and ints[states + i] == OPEN else 0
        strikes += 1 if ints[striking + i] == 1 and ints[asking + i] != NOBODY else 0
        asked = ints[states + i] if ints[asking + i] == NOBODY else ints[asking + i]
        ints[ints[COMPLIANT_KEY] + i] = OPEN if rigid else asked
        sticks = ints[ints[STICKS] + i]
        if bears_nothing(ints, numbers, i) == 1 and ints[ints[COMPLIANT_KEY] + i] >= sticks:  # slips, either way
            begins = ints[states + i] == sticks and asked > sticks
            ints[ints[COMPLIANT_KEY] + i] = asked if begins else max(ints[states + i], sticks + 1)
    if strikes == 0:
        status = stick_together(ints, numbers, waves, asking)
        left = 0
        for i in range(c):
            left += 1 if ints[asking + i] != NOBODY else 0
        if status < 0 or left == 0:
            return status
        return switch(ints, numbers, waves, asking)
    status = impact(ints, numbers, waves)
    if status < 0:
        return status
    if ints[CHANGE_COUNT] == before:
        clear(numbers, LOST_NOW)
        return close_without_impact(ints, numbers, waves, asking)
    enter(ints, numbers, waves, AFTER)
    return OK

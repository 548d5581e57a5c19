"""Unilateral contact: a gap that cannot become negative, or only against a stiffness.

    g(x) = h.x + gap,   open where g > 0;   the contact force lambda >= 0 [N] acts along +h.

    rigid      0 <= lambda, g >= 0, lambda g = 0, and g'+ >= -e g'- in an impact with g'- < 0  (Moreau)
    compliant  lambda = k max(0, -g)
    viscous    lambda = max(0, k (-g) + c (-g')) where g < 0, else 0
    bounded    lambda = f_c + f_d, f_c = k (-g), f_d = c (-g') but |f_d| <= f_c, where g < 0, else 0

A viscous contact closes when its gap falls through zero, and opens when its force falls to zero, which is before the
gap returns to zero: it never pulls. Within the stop it closes again when k (-g) + c (-g') rises through zero. The
damping work includes the strain energy k g^2 / 2 that is left when the contact opens within the stop (the damper
dissipates it while the spring relaxes), less the strain energy when it closes again there.

A bounded damper (Modelica's ElastoGap and Backlash) makes the force continuous: it rises from zero at the stop, and
falls to zero there. The contact has three states in the stop, each of them linear:

    compressed   c (-g') >= f_c           lambda = 2 k (-g)
    closed       |c g'| <= f_c            lambda = k (-g) + c (-g')
    released     c g' >= f_c              lambda = 0

It closes compressed, and opens at g = 0. `energy` counts the spring 2 k while it is compressed, and none while it is
released; what changes with the state is damping work.

Friction. For a closed contact that can slide along h_t, with the force N = lambda,

    stick   T = k_t (h_t.x - v_t t - w), without a spring h_t.x - v_t t = w and T its reaction,   |T| <= mu_s N
    slip    T = s mu N,   s (h_t.x' - v_t - T' / k_t) >= 0,   s = +1 or -1

The force on the structure is h N - h_t T. A contact that closes begins to stick at its position, or without a spring
slides in the direction of its velocity; one that opens has T = 0.

In an impact, a rigid contact has the impulse p along h, and q along -h_t, for all contacts that touch (Moreau):

    |q| <= mu p,   h_t.x'+ = v_t where it is smaller,   s (h_t.x'+ - v_t) >= 0 where q = s mu p

mu_s is not used in impacts. With e = 0 an impact dissipates energy. With e > 0 and friction, g'+ >= -e g'- might
generate energy (T. R. Kane). Then e is Poisson's: an impact with e = 0 and impulses p, followed by one with impulses of
at least e p and g'+ >= 0, again with friction; with the same e for all contacts it dissipates energy, too. A level in
which sliding has no unique motion is refused with its number (levels/level/sliding.py).

    normal            friction without a spring    with a spring k_t                     restitution and friction
    compliant         possible                     possible                              refused, as without friction
    viscous           possible                     refused: the end of slip depends on   refused, as without friction
                                                   N', which contains an acceleration
    rigid             possible                     refused: so does N' of a reaction     possible, by Poisson's law
    bounded           refused                      refused                               refused, as without friction
    force law         impossible: a law is not a contact, and has no N

The possible combinations hold for runs, steady states, frequency responses, static equilibria, and the Exudyn body,
alone and with an interface (there without a moving counter-surface). With static friction above the kinetic one, a
spring that begins to slip while the pressure falls faster than it relaxes sticks again at once, at mu N.

Sources: J. J. Moreau, Unilateral contact and dry friction in finite freedom dynamics, CISM 302 (1988); Ch. Glocker,
F. Pfeiffer, Multiple impacts with friction in rigid multibody systems, Nonlinear Dynamics 7 (1995).

A stop 1.35 mm below a beam that bends along +z has h = +e_c and gap = 1.35e-3; a stop above it has
h = -e_c; two bodies facing each other have one coefficient each.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, replace
from typing import ClassVar

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.mechanics.arguments import is_real
from multiphi_exudyn.mechanics.element import (
    ALWAYS_TAKEN,
    TAKEN_FALLING,
    TAKEN_ONCE,
    ElementState,
    Exit,
    Link,
    Share,
    Turn,
    contact_states,
)
from multiphi_exudyn.mechanics.structure import At

__all__ = ["UnilateralContact"]

DAMPERS = ("linear", "bounded")


@dataclass(frozen=True, eq=False)
class UnilateralContact:
    """One unilateral contact: a gap that cannot become negative, or only against a stiffness.

        g(x) = h.x + gap,   open where g > 0;   force lambda >= 0 [N] along +h

        rigid      lambda >= 0, g >= 0, lambda g = 0;  impact g'+ >= -e g'-  (Moreau)
        compliant  lambda = k max(0, -g)
        viscous    lambda = max(0, k (-g) + c (-g')) where g < 0, else 0
        bounded    lambda = f_c + f_d, f_c = k (-g), f_d = c (-g') but |f_d| <= f_c, where g < 0, else 0

        stick      T = k_t (h_t.x - v_t t - w), or the reaction;  |T| <= mu_s N
        slip       T = s mu N,  N = lambda,  s (h_t.x' - v_t - T' / k_t) >= 0,  s = 1 or -1

    The force on the structure is h N - h_t T. During stick without a spring h_t.x - v_t t = w is constant, and T is the
    reaction. A stop 1.35 mm below a beam that bends upward has h = +e_tip and gap = 1.35e-3; a stop above it has
    h = -e_tip; two bodies that face each other have one coefficient each. Two contacts are equal only if they are the
    same object.

    Parameters
    ----------
    name : str
        Name in levels, events and results.
    direction : str, mapping or array (n,)
        h, along which the gap opens: a point name, {point: coefficient} or a row.
    gap : float
        Distance [m] in the undeformed structure; negative is a preload.
    stiffness : float, default inf
        k [N/m], > 0; infinite for a rigid contact.
    damping : float, default 0.0
        c [N s/m], >= 0, with a finite stiffness.
    friction : float, default 0.0
        mu during slip, >= 0.
    tangential : str, mapping or array (n,), default None
        h_t, direction of sliding, in the same forms as h; needed with friction.
    static_friction : float, default None
        mu_s >= mu, limit of stick; None: mu.
    tangential_stiffness : float, default inf
        k_t [N/m] of the spring in series with the friction, for an elastic contact only; infinite for none.
    restitution : float, default 0.0
        e of a rigid contact, 0 to 1. Coupled contacts with a common impact need the same e.
    tangential_velocity : float, default 0.0
        v_t [m/s] of the counter-surface along +h_t.
    damper : {"linear", "bounded"}, default "linear"
        Whether the damper's force is at most the spring's, as Modelica's ElastoGap has it; then without friction.

    Raises
    ------
    MultiPhiTypeError
        For a name that is not a string, and values that are not numbers.
    MultiPhiValueError
        For values out of these ranges; damping of a rigid contact, a bounded damper without damping or with friction,
        restitution of a compliant contact, friction without a tangential direction, and a tangential spring of a rigid
        or a viscous contact.

    Examples
    --------
    >>> import numpy as np
    >>> import multiphi_exudyn as mp
    >>> K = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])  # N/m
    >>> chain = mp.LinearStructure(np.eye(3), K, mp.ModalDamping(0.01), {"tip": 2})
    >>> below = mp.UnilateralContact("below", "tip", gap=1e-3)  # rigid
    >>> above = mp.UnilateralContact("above", {"tip": -1.0}, gap=2e-3, stiffness=1e6)
    >>> below.rigid, above.rigid
    (True, False)
    >>> model = mp.MultiPhiModel(chain, [below, above])
    >>> tr = mp.simulate(model, 0.1, velocity=np.array([0.0, 0.0, 0.5]))
    >>> tr.events[0].contact
    'above'
    """

    name: str
    direction: At
    gap: float
    stiffness: float = math.inf
    damping: float = 0.0
    friction: float = 0.0
    tangential: At | None = None
    static_friction: float | None = None
    tangential_stiffness: float = math.inf
    restitution: float = 0.0
    tangential_velocity: float = 0.0
    damper: str = "linear"
    velocity: ClassVar[float] = 0.0
    held: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise MultiPhiTypeError(f"contact name: got {self.name!r}, need a non-empty string")
        tangential = "friction", "tangential_stiffness", "tangential_velocity"
        for name in ("gap", "stiffness", "damping", "restitution", *tangential):
            object.__setattr__(self, name, self._number(name, getattr(self, name)))
        if self.static_friction is not None:
            object.__setattr__(self, "static_friction", self._number("static_friction", self.static_friction))
        if not math.isfinite(self.gap):
            raise self._refused("gap", "need a finite distance")
        if not self.stiffness > 0:
            raise self._refused("stiffness", "need a value > 0 (or inf, rigid)")
        if not (math.isfinite(self.damping) and self.damping >= 0):
            raise self._refused("damping", "need a finite value >= 0")
        if self.rigid and self.damping:
            raise self._refused("damping", "need a finite stiffness", " beside an infinite stiffness")
        if not 0 <= self.restitution <= 1:
            raise self._refused("restitution", "need a value from 0 to 1")
        if self.restitution and not self.rigid:
            needed = "need stiffness=inf (the loss of a compliant contact is its damping)"
            raise self._refused("restitution", needed, " beside a finite stiffness")
        self._check_damper()
        self._check_friction()

    def _check_damper(self) -> None:
        if self.damper not in DAMPERS:
            raise self._refused("damper", f"need one of: {', '.join(DAMPERS)}")
        if self.bounded and not self.damping:
            raise self._refused("damper", "need a damping > 0", " beside the damping 0.0")
        if self.bounded and (self.friction or self.static_friction):
            raise self._refused("damper", "need 'linear', or no friction", " beside friction")

    def _check_friction(self) -> None:
        if not (math.isfinite(self.friction) and self.friction >= 0):
            raise self._refused("friction", "need a finite coefficient >= 0")
        if not (math.isfinite(self.most) and self.most >= self.friction):
            raise self._refused("static_friction", f"need a finite coefficient >= the friction {self.friction!r}")
        if self.tangential is None and self.most:
            raise self._refused("friction", "need one as well", " without a tangential direction")
        if not self.tangential_stiffness > 0:
            raise self._refused("tangential_stiffness", "need a value > 0 (or inf, without a spring)")
        if not math.isfinite(self.tangential_velocity):
            raise self._refused("tangential_velocity", "need a finite speed")
        if math.isfinite(self.tangential_stiffness) and (self.rigid or self.damping):
            beside = " beside an infinite stiffness" if self.rigid else f" beside the damping {self.damping!r}"
            raise self._refused("tangential_stiffness", "need inf, or an elastic contact", beside)

    def _number(self, name: str, value: object) -> float:
        if not is_real(value):
            raise MultiPhiTypeError(f"contact {self.name!r} {name}: got {value!r}, need a number")
        return float(value)  # type: ignore[arg-type]

    def _refused(self, name: str, needed: str, beside: str = "") -> MultiPhiValueError:
        return MultiPhiValueError(f"contact {self.name!r} {name}: got {getattr(self, name)!r}{beside}, {needed}")

    @property
    def rigid(self) -> bool:
        """True for an infinite stiffness."""
        return math.isinf(self.stiffness)

    @property
    def bounded(self) -> bool:
        """True for a damper whose force is at most that of the spring."""
        return self.damper == "bounded"

    @property
    def most(self) -> float:
        """mu_s, limit of stick."""
        return self.friction if self.static_friction is None else self.static_friction

    @property
    def drop(self) -> float:
        """Part of the tangential spring's energy that is lost when slip begins."""
        return 1 - (self.friction / self.most) ** 2 if self.most else 0.0

    @functools.cached_property
    def further(self) -> tuple[Link, ...]:
        """With friction: the tangential link, and two normal links with the friction of slip in either direction.

        With a bounded damper: the spring 2 k in place of spring and damper.
        """
        if self.bounded:
            return (Link(f"{self.name}.compressed", self.direction, self.gap, 2 * self.stiffness),)
        if self.tangential is None or not self.most:
            return ()
        along, normal = (self.direction, self.gap, self.stiffness, self.damping), (1.0, self.direction)
        stick = Link(
            f"{self.name}.tangential",
            self.tangential,
            0.0,
            self.tangential_stiffness,
            0.0,
            self.tangential_velocity,
            True,
        )
        slips = (
            Link(f"{self.name}.slip{sign}", *along, push=(normal, (-s * self.friction, self.tangential)))
            for sign, s in (("+", 1.0), ("-", -1.0))
        )
        return (stick, *slips)

    @functools.cached_property
    def states(self) -> tuple[ElementState, ...]:
        """States open and closed; with friction, open, stick, slip+, slip-, and for a compliant contact idle.

        With a bounded damper: open, closed, compressed, released.
        """
        if self.bounded:
            return self._bounded_states()
        plain = contact_states(self.rigid, self.damping > 0)
        if not self.further:
            return plain
        (closing,), (opening,) = (state.exits for state in plain)
        firmness = ALWAYS_TAKEN if math.isinf(self.tangential_stiffness) else TAKEN_FALLING
        stick = tuple(
            Exit(f"slip{sign}", force=self.most, firmness=firmness, further=(Share(1, force=s),))
            for sign, s in (("+", 1.0), ("-", -1.0))
        )
        turn = Turn(1, "slip+", "slip-") if math.isinf(self.tangential_stiffness) else None
        return (
            ElementState("open", "open", (replace(closing, asked="stick", turn=turn),)),
            ElementState("stick", "stick", (*stick, opening), holds=(0, 1)),
            self._slip("+", 1.0, 2, opening),
            self._slip("-", -1.0, 3, opening),
            *(() if self.rigid or turn is None else (self._idle(opening),)),
        )

    def _bounded_states(self) -> tuple[ElementState, ...]:
        """Signals q, and f_c - f_d = -k q + c q' and f_c + f_d = -k q - c q' of the forces in the stop, q = g."""
        k, c, opens = self.stiffness, self.damping, Exit("open", gap=-1.0)
        exceeds, pulls = Exit("compressed", gap=-k, rate=c), Exit("released", gap=-k, rate=-c)
        yields, presses = Exit("closed", gap=k, rate=-c), Exit("closed", gap=k, rate=c)
        at_bounds = (replace(each, firmness=TAKEN_ONCE) for each in (exceeds, pulls, yields, presses))
        exceeds, pulls, yields, presses = at_bounds
        return (
            ElementState("open", "open", (Exit("compressed", gap=1.0),)),
            ElementState("closed", "segment", (exceeds, pulls, opens), holds=(0,)),
            ElementState("compressed", "segment", (yields, opens), holds=(1,)),
            ElementState("released", "segment", (presses, opens)),
        )

    def _idle(self, opening: Exit) -> ElementState:
        """State without T, in which other sticking contacts keep h_t.x' = v_t; when this ends, the contact sticks."""
        moves = (Exit("stick", firmness=TAKEN_ONCE, further=(Share(1, rate=s),)) for s in (1.0, -1.0))
        return ElementState("idle", "stick", (*moves, opening), holds=(0,))

    def _slip(self, sign: str, s: float, link: int, opening: Exit) -> ElementState:
        """State with s (h_t.x' - v_t - s mu N' / k_t) >= 0, N' = -k h.x' of an elastic contact, and its opening."""
        share = Share(link, opening.gap, opening.rate, opening.force)
        opens = Exit("open", firmness=opening.firmness, further=(share,))
        if math.isinf(self.tangential_stiffness):
            back = Exit("stick", firmness=TAKEN_ONCE, further=(Share(1, rate=s),))
        else:
            ratio, firmness = self.friction / self.tangential_stiffness, ALWAYS_TAKEN if self.drop else TAKEN_ONCE
            back = Exit("stick", rate=ratio * self.stiffness, firmness=firmness, further=(Share(1, rate=s),))
        return ElementState(f"slip{sign}", "slip", (back, opens), holds=(link,), rubs=(link, s * self.friction))

    def first_state(self, gap: float, rate: float, *rates: float) -> str:
        """State at the start of a run with a gap [m], zero if it is round-off, and its rate [m/s].

        A rigid contact starts open, and closes at once if it is pressed; a viscous one never pulls. rates: of the
        further links; without a spring the contact sticks only without velocity relative to its counter-surface.
        """
        if self.bounded:
            if gap >= 0:
                return "open"
            if self.damping * abs(rate) <= -self.stiffness * gap:
                return "closed"
            return "compressed" if rate < 0 else "released"
        pulls = self.damping > 0 and self.stiffness * gap + self.damping * rate > 0
        if gap >= 0 or self.rigid or pulls:
            return "open"
        if not rates:
            return "closed"
        if math.isfinite(self.tangential_stiffness) or rates[0] == 0:
            return "stick"
        return "slip+" if rates[0] > 0 else "slip-"

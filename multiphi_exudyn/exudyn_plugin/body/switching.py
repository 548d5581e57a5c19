"""Switching: the one function Exudyn calls after every step, for all Multi-Phi bodies of a system.

Exudyn has a single place for such a function. Bodies share it, and what the user had installed before the first
body is called after them, with the coordinates and levels as the bodies left them. A function installed later
replaces this one; a run that ends without it is found out (``check_called``).

As long as every body knows when it has something to do next, the function compares the time with the first of these
times, and does nothing else.
"""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import exudyn as exu

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError, MultiPhiWarning

__all__ = ["BODIES", "Switching", "SwitchingBody", "bodies_of", "check_solver", "nothing_acts_on", "running_solver"]

BODIES = "multiPhi"  # key in mbs.variables

StepFunction = Callable[[Any, float], bool]


class SwitchingBody(Protocol):
    """What switching needs of a body: what it is called, and what is called on it around every step."""

    name: str
    items: dict[str, Any]

    @property
    def next_time(self) -> float:
        """When [s] it has something to do next, -inf where that is at the end of every step."""

    @property
    def clear(self) -> Callable[[float], int] | None:
        """Says at the end of a step, by its time [s], whether nothing is to do; None where ``next_time`` says it."""

    @property
    def rigid(self) -> bool:
        """Whether it has rigid contacts."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to distrust in the run that ends, a sentence each."""

    def before_step(self, mbs: Any, t: float) -> None:
        """What it does before a step that ends at t."""

    def after_step(self, mbs: Any, t: float) -> None:
        """What it does when a step is done, and at the start."""

    def look_again(self) -> None:
        """Take the present state as the start of the next step."""


class Clock:
    """The time of the last step [s], and when the bodies have something to do next; ``due`` is called then.

    clear: says at the end of a step before that, by its time [s], whether there is nothing to do, None for always.

    A class of its own, for what it does is done after every step: attributes of a dict take twice the time.
    """

    def __init__(self, due: StepFunction) -> None:
        self.due = due
        self.time = math.nan
        self.next_time = -math.inf
        self.clear: Callable[[float], int] | None = None

    def after_step(self, mbs: Any, t: float) -> bool:
        """Called by Exudyn; whether the run goes on."""
        if self.time < t < self.next_time and (self.clear is None or self.clear(t)):
            self.time = t
            return True
        return self.due(mbs, t)


class Switching(dict[str, SwitchingBody]):
    """Bodies of one system by name, and their common PreStep and PostStep user functions.

    preceding, following: the user's own PreStep and PostStep functions, or None. needed: whether any body has to be
    called. disturbed: whether an event of one body has just moved what hangs on it, maybe another. end: of the run [s],
    infinite once its warnings are issued. clock: whose function is the PostStep one.
    """

    def __init__(self) -> None:
        super().__init__()
        self.preceding: StepFunction | None = None
        self.following: StepFunction | None = None
        self.needed = False
        self.disturbed = False
        self.end = math.inf
        self.clock = Clock(self._switch)

    def add(self, body: SwitchingBody) -> None:
        """Take a body in; those with rigid contacts come last, so that what they strike has had its own events."""
        self[body.name] = body
        for other in [each for each in self.values() if each.rigid]:
            self[other.name] = self.pop(other.name)

    def before_step(self, mbs: Any, t: float) -> bool:
        """Called by Exudyn; whether the run goes on."""
        for body in self.values():
            body.before_step(mbs, t)
        return self.preceding is None or self.preceding(mbs, t)

    def _switch(self, mbs: Any, t: float) -> bool:
        """A step after which some body may have something to do, or the start of a run."""
        self.clock.time, self.clock.next_time = t, -math.inf
        for body in self.values():
            body.after_step(mbs, t)
        if self.disturbed and len(self) > 1:  # whose event it was has looked
            for body in self.values():
                body.look_again()
        self.disturbed = False
        if t >= self.end:
            self.end = math.inf
            self._warn()
        elif self.following is None:
            self.clock.next_time = min([self.end, *[body.next_time for body in self.values()]])
            self.clock.clear = _all_of([clear for body in self.values() if (clear := body.clear) is not None])
        return self.following is None or self.following(mbs, t)

    def begin(self) -> None:
        """A run of a solver begins."""
        self.clock.time, self.clock.next_time, self.clock.clear, self.end = math.nan, -math.inf, None, math.inf

    def check_called(self, t: float) -> None:
        """Raises if a run has come to t [s] without the bodies: somebody else's PostStep function is installed."""
        if self.needed and not self.clock.time >= t:
            raise MultiPhiValueError(
                f"PostStepUserFunction: got a function that replaced the one of {next(iter(self))!r}, which handles "
                "its events; need yours set before CreateMultiPhiBody, then both are called"
            )

    def _warn(self) -> None:
        """Issue what the bodies have to say of the run that ends."""
        for body in self.values():
            for sentence in body.warnings:
                warnings.warn(f"{sentence} (body {body.name!r})", MultiPhiWarning, stacklevel=3)

    def install(self, mbs: Any) -> None:
        """Become the system's PostStep function, followed by the present one."""
        self.needed = True
        present = _user_function("PostStep", mbs.GetPostStepUserFunction())
        if present != self.clock.after_step:
            self.following = present
            mbs.SetPostStepUserFunction(self.clock.after_step)

    def installed(self, mbs: Any) -> bool:
        """Whether these bodies switch in a run of the system."""
        present = _user_function("PostStep", mbs.GetPostStepUserFunction())
        return present is not None and present == self.clock.after_step

    def install_before(self, mbs: Any) -> None:
        """Become the system's PreStep function, followed by the present one."""
        present = _user_function("PreStep", mbs.GetPreStepUserFunction())
        if present != self.before_step:
            self.preceding = present
            mbs.SetPreStepUserFunction(self.before_step)


def _all_of(tests: Sequence[Callable[[float], int]]) -> Callable[[float], int] | None:
    """Whether all say so; those that have said so are not asked again for the same time."""
    if len(tests) < 2:
        return tests[0] if tests else None
    return lambda t: min(test(t) for test in tests)


def _user_function(name: str, present: Any) -> StepFunction | None:
    function = present["function"] if isinstance(present, dict) else present
    if function and not callable(function):
        raise MultiPhiTypeError(f"{name}UserFunction: got {function!r}, need a Python function or 0")
    return function or None


def bodies_of(mbs: Any) -> Switching:
    """All Multi-Phi bodies of a system, from ``mbs.variables``."""
    return mbs.variables.setdefault(BODIES, Switching())


def running_solver(mbs: Any, t: float) -> Any:
    """The implicit dynamic solver at work at time t, None inside SolveStatic."""
    dynamic = mbs.sys.get("dynamicSolver")
    if _at_work(dynamic, t):
        implicit = isinstance(dynamic, exu.MainSolverImplicitSecondOrder)
        check_solver(implicit, type(dynamic).__name__, bodies_of(mbs))
        return dynamic
    if not _at_work(mbs.sys.get("staticSolver"), t):
        raise MultiPhiValueError("SolveDynamic: got a solver that is not stored, need storeSolver=True")
    return None


def check_solver(implicit: bool, name: str, bodies: Mapping[str, Any]) -> None:
    """Raises for a dynamic solver that has no implicit steps."""
    if not implicit:
        raise MultiPhiValueError(
            f"solver: got {name}, which is explicit; need an implicit one for the Multi-Phi body "
            f"{next(iter(bodies))!r}: mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)"
        )


def nothing_acts_on(mbs: Any, node: Any, body: Any) -> bool:
    """Whether no item of the system refers to a node or its body, and no user function could change them."""
    bodies = bodies_of(mbs)
    before = _user_function("PreStep", mbs.GetPreStepUserFunction())
    if bodies.following or bodies.preceding or before not in (None, bodies.before_step):
        return False
    if not bodies.installed(mbs) or mbs.GetPostNewtonUserFunction():
        return False
    own = mbs.GetObject(body)
    if any(own[key] for key in own if key.endswith("UserFunction")):
        return False
    data = mbs.systemData
    markers = (mbs.GetMarker(exu.MarkerIndex(i)) for i in range(data.NumberOfMarkers()))
    others = (mbs.GetObject(exu.ObjectIndex(i)) for i in range(data.NumberOfObjects()) if i != int(body))
    return not any(_refers(item, node, body) for item in itertools.chain(markers, others))


def _refers(item: Mapping[str, Any], node: Any, body: Any) -> bool:
    nodes = [item.get("nodeNumber"), *item.get("nodeNumbers", ())]
    bodies = [item.get("bodyNumber"), item.get("objectNumber"), *item.get("bodyNumbers", ())]
    return int(node) in (int(n) for n in nodes if n is not None) or int(body) in (
        int(b) for b in bodies if b is not None
    )


def _at_work(solver: Any, t: float) -> bool:
    return solver is not None and not solver.output.finishedSuccessfully and solver.it.currentTime == t

"""Switching: the PostStep user function of a system, which handles the events of all its Multi-Phi bodies.

Exudyn has one such function per system. All bodies share it. A function that the user installed before the first body
is called after the bodies, with the coordinates and levels that they have written. A function that is installed later
replaces this one; ``check_called`` detects a run that ends without it.

While every body knows the time of its next action, the function only compares the present time with the earliest one.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import exudyn as exu

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.body.solver.static_solution import StaticChange
from multiphi_exudyn.time.warnings.warning_groups import CALLER, issue

__all__ = ["BODIES", "Switching", "SwitchingBody", "bodies_of", "check_solver", "is_isolated", "running_solver"]

BODIES = "multiPhi"  # key in mbs.variables

StepFunction = Callable[[Any, float], bool]


class SwitchingBody(Protocol):
    """Attributes of a body, and its functions that are called before and after steps."""

    name: str
    items: dict[str, Any]

    @property
    def next_time(self) -> float:
        """Time [s] of its next action, -inf for an action at the end of every step."""

    @property
    def is_step_clear(self) -> Callable[[float], int] | None:
        """Function of the end of a step [s], nonzero if the body needs no action; None where ``next_time`` decides."""

    @property
    def rigid(self) -> bool:
        """Whether it has rigid contacts."""

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings about the accuracy of the run, a sentence each."""

    def before_step(self, mbs: Any, t: float) -> None:
        """Act before a step that ends at t [s]."""

    def after_step(self, mbs: Any, t: float) -> None:
        """Act at the end of a step at t [s], and at the start of a run."""

    def restart_step(self) -> None:
        """Take the present state as the start of the next step."""

    def take_steps(self, duration: float, step: float) -> None:
        """Take notice of a run of this duration in steps of this length [s]."""

    def end_run(self) -> None:
        """Act at the end of a run."""

    @property
    def elements(self) -> int:
        """Number of contacts, force laws and friction elements."""

    def begin_static(self) -> None:
        """Begin a static solution."""

    def static_changes(self) -> list[StaticChange]:
        """Changes of elements whose states do not agree with the static solution."""

    def change_static_level(self, change: StaticChange) -> None:
        """Take the state of an element in the next static solution."""


class Clock:
    """Time of the last step [s], and time [s] of the next action of a body, at which ``switch`` is called.

    is_step_clear: function of the end of a step [s] before that, zero if an action is needed; None if never.

    A class of its own for speed, as it runs after every step: attributes of a dict would take twice the time.
    """

    def __init__(self, switch: StepFunction) -> None:
        self.switch = switch
        self.time = math.nan
        self.next_time = -math.inf
        self.is_step_clear: Callable[[float], int] | None = None

    def after_step(self, mbs: Any, t: float) -> bool:
        """Handle the end of a step at t [s]; called by Exudyn, returns whether the run goes on."""
        if self.time < t < self.next_time and (self.is_step_clear is None or self.is_step_clear(t)):
            self.time = t
            return True
        return self.switch(mbs, t)


class Switching(dict[str, SwitchingBody]):
    """Bodies of one system by name, and their common PreStep and PostStep user functions.

    user_pre_step, user_post_step: the user's own functions, or None. is_required: whether a body needs these calls.
    others_disturbed: whether an event has just changed what is attached to a body, which may be another body. end_time:
    of the run [s], infinite once its warnings are issued. clock: has the function that is installed as PostStep.
    """

    def __init__(self) -> None:
        super().__init__()
        self.user_pre_step: StepFunction | None = None
        self.user_post_step: StepFunction | None = None
        self.is_required = False
        self.others_disturbed = False
        self.end_time = math.inf
        self.clock = Clock(self._switch)

    def add(self, body: SwitchingBody) -> None:
        """Add a body; those with rigid contacts come last, after the events of the parts that they strike."""
        self[body.name] = body
        for other in [each for each in self.values() if each.rigid]:
            self[other.name] = self.pop(other.name)

    def before_step(self, mbs: Any, t: float) -> bool:
        """Act before a step that ends at t [s]; called by Exudyn, returns whether the run goes on."""
        for body in self.values():
            body.before_step(mbs, t)
        return self.user_pre_step is None or self.user_pre_step(mbs, t)

    def _switch(self, mbs: Any, t: float) -> bool:
        """Handle a step after which a body may have to act, or the start of a run."""
        self.clock.time, self.clock.next_time = t, -math.inf
        for body in self.values():
            body.after_step(mbs, t)
        if self.others_disturbed and len(self) > 1:  # the body of the event is up to date
            for body in self.values():
                body.restart_step()
        self.others_disturbed = False
        if t >= self.end_time:
            self.end_time = math.inf
            for body in self.values():
                body.end_run()
            self.warn()
        elif self.user_post_step is None:
            self.clock.next_time = min([self.end_time, *[body.next_time for body in self.values()]])
            tests = [test for body in self.values() if (test := body.is_step_clear) is not None]
            self.clock.is_step_clear = _combined_check(tests)
        return self.user_post_step is None or self.user_post_step(mbs, t)

    def begin_run(self) -> None:
        """Begin a run of a solver."""
        self.clock.time, self.clock.next_time, self.clock.is_step_clear, self.end_time = (
            math.nan,
            -math.inf,
            None,
            math.inf,
        )

    def take_steps(self, duration: float, count: int) -> None:
        """Take notice of a run of this duration [s] in so many steps, in which the bodies were not called; warn."""
        for body in self.values():
            body.take_steps(duration, duration / max(count, 1))
        self.warn()

    def check_called(self, t: float) -> None:
        """Raise if a run has reached t [s] without calls of the bodies: another PostStep function is installed."""
        if self.is_required and not self.clock.time >= t:
            raise MultiPhiValueError(
                f"PostStepUserFunction: got a function that replaced the one of {next(iter(self))!r}, which handles "
                "its events; need yours set before CreateMultiPhiBody, then both are called"
            )

    def warn(self) -> None:
        """Issue the warnings of the bodies about the run or the static solution."""
        for body in self.values():
            issue((f"{sentence} (body {body.name!r})" for sentence in body.warnings), CALLER + 1)

    def install(self, mbs: Any) -> None:
        """Install the PostStep function of the system, which then calls the present one."""
        self.is_required = True
        present = _user_function("PostStep", mbs.GetPostStepUserFunction())
        if present != self.clock.after_step:
            self.user_post_step = present
            mbs.SetPostStepUserFunction(self.clock.after_step)

    def is_installed(self, mbs: Any) -> bool:
        """Whether the PostStep function of these bodies is installed."""
        present = _user_function("PostStep", mbs.GetPostStepUserFunction())
        return present is not None and present == self.clock.after_step

    def install_pre_step(self, mbs: Any) -> None:
        """Install the PreStep function of the system, which then calls the present one."""
        present = _user_function("PreStep", mbs.GetPreStepUserFunction())
        if present != self.before_step:
            self.user_pre_step = present
            mbs.SetPreStepUserFunction(self.before_step)


def _combined_check(tests: Sequence[Callable[[float], int]]) -> Callable[[float], int] | None:
    """One test for several bodies, nonzero if all are; one that passes has begun the next step and is not repeated."""
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
    """The implicit dynamic solver that is running at time t [s], None inside SolveStatic."""
    dynamic = mbs.sys.get("dynamicSolver")
    if _is_running(dynamic, t):
        implicit = isinstance(dynamic, exu.MainSolverImplicitSecondOrder)
        check_solver(implicit, type(dynamic).__name__, bodies_of(mbs))
        return dynamic
    if not _is_running(mbs.sys.get("staticSolver"), t):
        raise MultiPhiValueError("SolveDynamic: got a solver that is not stored, need storeSolver=True")
    return None


def check_solver(implicit: bool, name: str, bodies: Mapping[str, Any]) -> None:
    """Raise for a dynamic solver that is not implicit."""
    if not implicit:
        raise MultiPhiValueError(
            f"solver: got {name}, which is explicit; need an implicit one for the Multi-Phi body "
            f"{next(iter(bodies))!r}: mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)"
        )


def is_isolated(mbs: Any, node: Any, body: Any) -> bool:
    """Whether no item of the system refers to a node or its body, and no user function may change them."""
    bodies = bodies_of(mbs)
    before = _user_function("PreStep", mbs.GetPreStepUserFunction())
    if bodies.user_post_step or bodies.user_pre_step or before not in (None, bodies.before_step):
        return False
    if not bodies.is_installed(mbs) or mbs.GetPostNewtonUserFunction():
        return False
    parameters = mbs.GetObject(body)
    if any(parameters[key] for key in parameters if key.endswith("UserFunction")):
        return False
    data = mbs.systemData
    markers = (mbs.GetMarker(exu.MarkerIndex(i)) for i in range(data.NumberOfMarkers()))
    others = (mbs.GetObject(exu.ObjectIndex(i)) for i in range(data.NumberOfObjects()) if i != int(body))
    return not any(_refers_to(item, node, body) for item in itertools.chain(markers, others))


def _refers_to(item: Mapping[str, Any], node: Any, body: Any) -> bool:
    nodes = [item.get("nodeNumber"), *item.get("nodeNumbers", ())]
    bodies = [item.get("bodyNumber"), item.get("objectNumber"), *item.get("bodyNumbers", ())]
    return int(node) in (int(n) for n in nodes if n is not None) or int(body) in (
        int(b) for b in bodies if b is not None
    )


def _is_running(solver: Any, t: float) -> bool:
    return solver is not None and not solver.output.finishedSuccessfully and solver.it.currentTime == t

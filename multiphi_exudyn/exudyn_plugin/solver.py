"""The solver and the bodies: their common PostStep function, what they need of a solver, and static solutions.

Exudyn has one PostStep user function per system, which handles the events of all its Multi-Phi bodies. A function that
the user installed before the first body is called after the bodies, with the coordinates and levels that they have
written. A function that is installed later replaces this one; ``check_called`` detects a run that ends without it.
While every body knows the time of its next action, the function only compares the present time with the earliest one.

Exudyn wraps an error that a body raises during a run in an error about user functions. Therefore SolveDynamic checks
beforehand, as a method of the system and as a function of Exudyn's modules, and so does the explicit solver when it is
called itself; errors of bodies during a run are raised without Exudyn's wrapping. Any run of the implicit solver in
which the bodies were not called up to its end raises an error at its end.

A static solution ends in the level whose contacts and reactions agree with it. Exudyn solves with the matrices of one
level. There every signal of an exit has to be at least zero: gaps of open contacts, forces of closed ones, the distance
of a force law to the ends of its segment, and the reserve of friction that sticks. Where some are negative, the element
of the most negative one, relative to its terms, takes the exit and Exudyn solves again. If this does not end, the first
of them does, in a fixed order, which ends where contacts have one equilibrium. Where friction slips on the way, and
where a contact that closes then sticks, depends on the path of the loads, which a static solution does not follow. So
elements with friction have to keep their states.

Source: K. G. Murty, Note on a Bard-type scheme for solving the complementarity problem, Opsearch 11 (1974).
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import exudyn as exu
import exudyn.solver

from multiphi_exudyn.errors import MultiPhiError, MultiPhiTypeError, MultiPhiValueError, NumericalFailure
from multiphi_exudyn.exudyn_plugin.body import MultiPhiBody
from multiphi_exudyn.exudyn_plugin.state import SAME_STEP
from multiphi_exudyn.time.model_warnings import CALLER, issue

__all__ = ["Switching", "bodies_of", "install_checks"]

BODIES = "multiPhi"  # key in mbs.variables
GREEDY = 5  # static solutions for every element after which the element of the most negative signal takes its exit
MOST = 20  # static solutions for every element: more is an endless cycle
IMPLICIT = (exu.DynamicSolverType.GeneralizedAlpha, exu.DynamicSolverType.TrapezoidalIndex2)
_CHECKED = "_multiPhiChecked"  # attribute of a function that already checks

StepFunction = Callable[[Any, float], bool]


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


class Switching(dict[str, MultiPhiBody]):
    """Bodies of one system by name, and their common PreStep and PostStep user functions.

    user_pre_step, user_post_step: the user's own functions, or None. is_required: whether a body needs these calls.
    end_time: of the run [s], infinite once its warnings are issued. clock: has the function installed as PostStep.
    """

    def __init__(self) -> None:
        super().__init__()
        self.user_pre_step: StepFunction | None = None
        self.user_post_step: StepFunction | None = None
        self.is_required = False
        self.end_time = math.inf
        self.clock = Clock(self._switch)

    def add(self, body: MultiPhiBody) -> None:
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
        solver = running_solver(mbs, t, self)
        if solver is None:
            for body in self.values():
                body.set_static_level(mbs)
        elif solver.it.currentStepIndex == 0:
            self._begin(mbs, t, solver)
        else:
            moved = [body.after_step(mbs, t) for body in self.values()]
            for body in self.values() if any(moved) and len(moved) > 1 else ():  # another body may be what has moved
                body.restart_step()
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

    def _begin(self, mbs: Any, t: float, solver: Any) -> None:
        """Begin a run at t [s]."""
        for body in self.values():
            exclusive = {
                mbs.GetNodeODE2Index(other.items["nGenericODE2"]): other.name
                for other in self.values()
                if other is not body and body.rigid and other.rigid
            }
            body.begin(mbs, t, self._is_isolated(mbs, body), exclusive)
        end = float(mbs.sys["simulationSettings"].timeIntegration.endTime)
        self.end_time = end - SAME_STEP * float(solver.it.currentStepSize)

    def _is_isolated(self, mbs: Any, body: MultiPhiBody) -> bool:
        """Whether no item of the system refers to a body or its node, and no user function may change them."""
        node, item = body.items["nGenericODE2"], body.items["oGenericODE2"]
        before = _user_function("PreStep", mbs.GetPreStepUserFunction())
        if self.user_post_step or self.user_pre_step or before not in (None, self.before_step):
            return False
        if not self.is_installed(mbs) or mbs.GetPostNewtonUserFunction():
            return False
        parameters = mbs.GetObject(item)
        if any(parameters[key] for key in parameters if key.endswith("UserFunction")):
            return False
        data = mbs.systemData
        markers = (mbs.GetMarker(exu.MarkerIndex(i)) for i in range(data.NumberOfMarkers()))
        others = (mbs.GetObject(exu.ObjectIndex(i)) for i in range(data.NumberOfObjects()) if i != int(item))
        return not any(_refers_to(other, node, item) for other in itertools.chain(markers, others))

    def begin_run(self) -> None:
        """Begin a run of a solver."""
        self.clock.time, self.clock.next_time, self.clock.is_step_clear = math.nan, -math.inf, None
        self.end_time = math.inf

    def take_steps(self, mbs: Any, duration: float, count: int) -> None:
        """Take notice of a run of this duration [s] in so many steps, in which the bodies were not called; warn."""
        for body in self.values():
            body.take_steps(mbs, duration, duration / max(count, 1))
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


def running_solver(mbs: Any, t: float, bodies: Mapping[str, Any]) -> Any:
    """The implicit dynamic solver that is running at time t [s], None inside SolveStatic."""
    dynamic = mbs.sys.get("dynamicSolver")
    if _is_running(dynamic, t):
        check_solver(isinstance(dynamic, exu.MainSolverImplicitSecondOrder), type(dynamic).__name__, bodies)
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


def _refers_to(item: Mapping[str, Any], node: Any, body: Any) -> bool:
    nodes = [item.get("nodeNumber"), *item.get("nodeNumbers", ())]
    bodies = [item.get("bodyNumber"), item.get("objectNumber"), *item.get("bodyNumbers", ())]
    return int(node) in (int(n) for n in nodes if n is not None) or int(body) in (
        int(b) for b in bodies if b is not None
    )


def _is_running(solver: Any, t: float) -> bool:
    return solver is not None and not solver.output.finishedSuccessfully and solver.it.currentTime == t


def install_checks() -> None:
    """Make Exudyn's SolveDynamic check the requirements of Multi-Phi bodies; other systems are solved as before."""
    for owner in (exu.MainSystem, exu, exu.solver):
        present = owner.SolveDynamic
        if not hasattr(present, _CHECKED):
            owner.SolveDynamic = _with_check(present)
    for solver, wrapper in (
        (exu.MainSolverImplicitSecondOrder, _with_end_check),
        (exu.MainSolverExplicit, _with_refusal),
        (exu.MainSolverStatic, _with_levels),
    ):
        if not hasattr(solver.SolveSystem, _CHECKED):
            solver.SolveSystem = wrapper(solver.SolveSystem)


def _with_check(solve: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(solve)
    def solve_dynamic(
        mbs: Any, simulationSettings: Any = None, solverType: Any = None, *arguments: Any, **keywords: Any
    ) -> Any:
        bodies = mbs.variables.get(BODIES)
        if bodies is not None and bodies.is_installed(mbs):
            settings = exu.SimulationSettings() if simulationSettings is None else simulationSettings
            kind = settings.timeIntegration.solverType if solverType is None else solverType
            check_solver(kind in IMPLICIT, kind.name, bodies)
            for body in bodies.values():
                body.check_integration(settings, trapezoidal=kind == exu.DynamicSolverType.TrapezoidalIndex2)
        with _unwrapped_errors():
            return solve(mbs, simulationSettings, solverType, *arguments, **keywords)

    setattr(solve_dynamic, _CHECKED, True)
    return solve_dynamic


def _with_end_check(solve: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(solve)
    def solve_system(solver: Any, mbs: Any, *arguments: Any, **keywords: Any) -> Any:
        bodies = mbs.variables.get(BODIES)
        if bodies is None:
            return solve(solver, mbs, *arguments, **keywords)
        bodies.begin_run()
        try:
            with _unwrapped_errors():
                result = solve(solver, mbs, *arguments, **keywords)
        except BaseException:
            bodies.clock.next_time = -math.inf
            raise
        if solver.output.finishedSuccessfully:
            bodies.check_called(solver.it.currentTime)
            if not bodies.is_required:  # linear bodies are not called
                settings = arguments[0] if arguments else keywords["simulationSettings"]
                duration = solver.it.currentTime - settings.timeIntegration.startTime
                bodies.take_steps(mbs, duration, solver.it.currentStepIndex)
        return result

    setattr(solve_system, _CHECKED, True)
    return solve_system


def _with_levels(solve: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(solve)
    def solve_system(solver: Any, mbs: Any, *arguments: Any, **keywords: Any) -> Any:
        bodies = mbs.variables.get(BODIES)
        if bodies is None or not bodies.is_required:
            return solve(solver, mbs, *arguments, **keywords)

        def solve_once() -> bool:
            bodies.begin_run()
            done = bool(solve(solver, mbs, *arguments, **keywords))
            if done:
                bodies.check_called(solver.it.currentTime)
            return done

        with _unwrapped_errors():
            done = solve_static(solve_once, bodies.values())
        if done:
            bodies.warn()
        return done

    setattr(solve_system, _CHECKED, True)
    return solve_system


def _with_refusal(solve: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(solve)
    def solve_system(solver: Any, mbs: Any, *arguments: Any, **keywords: Any) -> Any:
        bodies = mbs.variables.get(BODIES)
        if bodies is not None and bodies.is_installed(mbs):
            check_solver(False, type(solver).__name__, bodies)
        return solve(solver, mbs, *arguments, **keywords)

    setattr(solve_system, _CHECKED, True)
    return solve_system


@contextmanager
def _unwrapped_errors() -> Iterator[None]:
    """Raise errors of bodies in user functions without Exudyn's error around them."""
    try:
        yield
    except Exception as error:
        if isinstance(error.__cause__, MultiPhiError):
            raise error.__cause__ from None
        raise


def solve_static(solve: Callable[[], bool], bodies: Iterable[MultiPhiBody]) -> bool:
    """Solve until the levels of all bodies agree with the static solution; return whether the solver succeeded.

    Raises NumericalFailure where no level agrees, and by the bodies where friction would change its state.
    """
    solved = tuple(bodies)
    for body in solved:
        body.begin_static()
    count = sum(body.elements for body in solved)
    for solution in range(1 + MOST * count):
        if not solve():
            return False
        changes = [(body, change) for body in solved for change in body.static_changes()]
        if not changes:
            return True
        greedy = solution < GREEDY * count
        body, change = min(changes, key=lambda each: each[1].signal) if greedy else changes[0]
        body.change_static_level(change)
    raise NumericalFailure(
        f"static solution of {body.name!r}: no level was found whose contacts agree with it; need more modes, "
        "or start=model.equilibrium({point: force}) of the model in place of SolveStatic"
    )

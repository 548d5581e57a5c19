"""Static solutions with Multi-Phi bodies: each ends in the level whose contacts and reactions agree with it.

Exudyn solves with the matrices of one level. There every signal of an exit has to be at least zero: gaps of open
contacts, forces of closed ones, the distance of a force law to the ends of its segment, and the reserve of friction
that sticks. Where some are negative, the element of the most negative one, relative to its terms, takes the exit and
Exudyn solves again. If this does not end, the first of them does, in a fixed order, which ends where contacts have one
equilibrium.

Where friction slips on the way, and where a contact that closes then sticks, depends on the path of the loads, which a
static solution does not follow. So elements with friction have to keep their states.

Source: K. G. Murty, Note on a Bard-type scheme for solving the complementarity problem, Opsearch 11 (1974).

Switching: the PostStep user function of a system, which handles the events of all its Multi-Phi bodies.

Exudyn has one such function per system. All bodies share it. A function that the user installed before the first body
is called after the bodies, with the coordinates and levels that they have written. A function that is installed later
replaces this one; ``check_called`` detects a run that ends without it.

While every body knows the time of its next action, the function only compares the present time with the earliest one.

Run checks: requirements of a body on the solver, on its step size, and on the system at the start of a run.

SolveDynamic with Multi-Phi bodies: their requirements on the solver are checked before it starts.

Exudyn wraps an error that a body raises during a run in an error about user functions. Therefore SolveDynamic checks
beforehand, as a method of the system and as a function of Exudyn's modules, and so does the explicit solver when it is
called itself; errors of bodies during a run are raised without Exudyn's wrapping. Any run of the implicit solver in
which the bodies were not called up to its end raises an error at its end. A static solution is repeated until the
levels of the bodies agree with it (above).

Binding of Create functions to Exudyn's MainSystem, so that they read as Exudyn's own: ``mbs.CreateX(...)``.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple, Protocol

import exudyn as exu
import exudyn.solver
import numpy as np

from multiphi_exudyn.errors import MultiPhiError, MultiPhiTypeError, MultiPhiValueError, NumericalFailure
from multiphi_exudyn.exudyn_plugin.state import SAME_STEP, Coordinates
from multiphi_exudyn.time.loaded_level import LoadedLevel
from multiphi_exudyn.time.model_warnings import CALLER, issue

RESIDUAL = 1e-7  # of its terms: a signal that is less negative is the residual of the solver's iterations
GREEDY = 5  # solutions for every element after which the element of the most negative signal takes its exit
MOST = 20  # solutions for every element: more is an endless cycle
BODIES = "multiPhi"  # key in mbs.variables
ROUND_OFF = 1e-12  # of the energy at the start: an impact with a smaller loss is none
IMPLICIT = (exu.DynamicSolverType.GeneralizedAlpha, exu.DynamicSolverType.TrapezoidalIndex2)
_CHECKED = "_multiPhiChecked"  # attribute of a function that already checks


class StaticChange(NamedTuple):
    """Change of an element to a state that its signal asks for; signal: relative to its terms, from -1 to 0."""

    signal: float
    element: int
    state: int


class SolvedBody(Protocol):
    """Attributes of a body that its static solution needs."""

    name: str

    @property
    def elements(self) -> int:
        """Number of contacts, force laws and friction elements."""

    def begin_static(self) -> None:
        """Begin with the level of the data node."""

    def static_changes(self) -> list[StaticChange]:
        """Changes of elements whose states do not agree with the present static solution."""

    def change_static_level(self, change: StaticChange) -> None:
        """Take the state of an element in the next static solution."""


def solve_static(solve: Callable[[], bool], bodies: Iterable[SolvedBody]) -> bool:
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


def static_changes(body: str, level: LoadedLevel, xi: np.ndarray, reactions: np.ndarray) -> list[StaticChange]:
    """Changes of elements whose exits have negative signals at rest, in the order of the elements.

    xi: coordinates of the level. reactions: L f (k,) [N] of its links to forces on points, which xi does not contain.
    Raises MultiPhiValueError where friction would change its state, or slips at rest.
    """
    base, changes = level.level.base, []
    for (element, exit_), (place, _, constant) in zip(level.exits, level.signals, strict=True):
        shares = [share * reactions[link] for link, share in level.force_shares(element, exit_)]
        terms = np.array([*(place * xi), constant, *shares])
        signal, size = float(np.sum(terms)), float(np.sum(np.abs(terms)))
        comes_to_rest = exit_.asked == "stick" and level.state_of(element).event == "slip"
        if signal >= -RESIDUAL * size and not (comes_to_rest and signal <= 0):
            continue
        if any(base.links[link].held for link in base.link_indices[element]):
            name = base.contacts[element].name
            raise MultiPhiValueError(
                f"static solution of {body!r}: got forces that change the state of {name!r}, whose friction depends on "
                "their path; need start=model.equilibrium({point: force}), or a damped run that comes to rest"
            )
        changes.append(StaticChange(signal / size, element, level.asked_state(element, exit_)))
    return changes


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

    def take_steps(self, mbs: Any, duration: float, step: float) -> None:
        """Take notice of a run of this duration in steps of this length [s], in which it was not called."""

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


class CheckedBody(Protocol):
    """Attributes of a body that the checks need; matched_step: step size [s] its modes are matched to, or None."""

    name: str
    items: dict[str, Any]
    coordinates: Coordinates
    matched_step: float | None


def check_matched(body: CheckedBody, step: float) -> None:
    """Raise where modes are matched to another step size than this one [s]."""
    if body.matched_step is not None and abs(step - body.matched_step) > SAME_STEP * step:
        raise MultiPhiValueError(
            f"matchedStepSize of {body.name!r}: got {body.matched_step:g} s and a solver's step of "
            f"{step:g} s, need the same (beside Exudyn's own contacts set discontinuous.useRecommendedStepSize=False)"
        )


def check_level(body: CheckedBody, states: tuple[int, ...], last_states: tuple[int, ...], last: np.ndarray) -> None:
    """Raise for a start at the coordinates (s,) of the last solution in another level than its own.

    states, last_states: of the elements at the start, and in the last solution.
    """
    if states != last_states and np.array_equal(body.coordinates.views[0], last):
        raise MultiPhiValueError(
            f"start of {body.name!r}: got the coordinates of the last solution without its level, need its whole "
            "state: updateInitialValues=True, or "
            "mbs.systemData.SetSystemState(mbs.systemData.GetSystemState(), exu.ConfigurationType.Initial)"
        )


def check_integration(body: CheckedBody, settings: Any, trapezoidal: bool) -> None:
    """Raise for settings of an implicit solver with which a body is not exact or unstable.

    trapezoidal: whether the solver is TrapezoidalIndex2, which does not use the settings of GeneralizedAlpha.
    """
    integration, interface = settings.timeIntegration.generalizedAlpha, body.coordinates.interface
    if not (trapezoidal or integration.useNewmark) and integration.spectralRadius != 1:
        other = "" if interface is not None else " (or spectralRadius = 1)"
        raise MultiPhiValueError(
            f"solver: got GeneralizedAlpha with spectralRadius {integration.spectralRadius:g} (Exudyn's default is "
            f"0.9), with which events of the Multi-Phi body {body.name!r} are not exact; need TrapezoidalIndex2"
            f"{other}: mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)"
        )
    if interface is not None and not (trapezoidal or integration.useIndex2Constraints):
        raise MultiPhiValueError(
            f"solver: got GeneralizedAlpha of index 3, with which the interface of {body.name!r} is unstable; need "
            "TrapezoidalIndex2: mbs.SolveDynamic(settings, solverType=exu.DynamicSolverType.TrapezoidalIndex2)"
        )


def check_start(mbs: Any, body: CheckedBody, start: Sequence[np.ndarray], loss: float) -> None:
    """Raise for masses and constraints that cannot take part in impacts of a body with rigid contacts.

    start: q, q' (s,) at creation; loss: energy loss of the impacts there [J].
    """
    coordinates = body.coordinates
    system = coordinates.system or coordinates.system_around(mbs)
    if system.acts_on_body(coordinates.stepped.mass):
        raise MultiPhiValueError(
            f"node of {body.name!r}: got a mass or a constraint on the node of a body with rigid contacts, need it "
            "on an interface coordinate or as part of the structure, or contacts of finite stiffness"
        )
    system.exclusive_bodies = {
        mbs.GetNodeODE2Index(other.items["nGenericODE2"]): other.name
        for other in bodies_of(mbs).values()
        if other is not body and other.rigid
    }
    inertia = system.attached_parts(system.copy_state(), coordinates.stepped.mass).inertia
    q_t = coordinates.views[1]
    as_created = np.array_equal(coordinates.views[:2], start)
    has_impact = as_created and loss > ROUND_OFF * (loss + 0.5 * float(q_t @ q_t))
    if has_impact and np.any(inertia.impedance(np.eye(len(inertia.mass)))):
        raise MultiPhiValueError(
            f"start of {body.name!r}: got a velocity into a rigid contact, with masses or constraints on the "
            "interface, need a start without an impact"
        )


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
                check_integration(body, settings, trapezoidal=kind == exu.DynamicSolverType.TrapezoidalIndex2)
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


def bind(function: Callable[..., Any]) -> None:
    """Make ``function(mbs, ...)`` a method of ``mbs``, unless Exudyn has a method of this name itself.

    Exudyn's registry is used if it exists, else a plain class attribute.
    """
    name = function.__name__
    if hasattr(exu.MainSystem, name):
        return
    try:
        from exudyn.misc.extensionRegistry import extends, install
    except ImportError:
        setattr(exu.MainSystem, name, function)
        return
    extends(exu.MainSystem, name)(function)
    install()

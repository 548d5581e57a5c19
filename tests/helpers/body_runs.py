"""Short runs of one Multi-Phi body in Exudyn, with Newton's tolerances far below what is looked at."""

import exudyn as exu
from exudyn.itemInterface import MarkerNodeCoordinate

from multiphi_exudyn.exudyn_plugin import CreateMultiPhiBody, body_histories

__all__ = ["TRAPEZOIDAL", "coordinate", "run", "settings", "system"]

TRAPEZOIDAL = exu.DynamicSolverType.TrapezoidalIndex2


def settings(step, end):
    settings = exu.SimulationSettings()
    settings.timeIntegration.numberOfSteps = round(end / step)
    settings.timeIntegration.endTime = end
    settings.timeIntegration.verboseMode = 0
    settings.timeIntegration.newton.useModifiedNewton = True
    settings.timeIntegration.newton.relativeTolerance = 1e-12
    settings.timeIntegration.newton.absoluteTolerance = 1e-14
    settings.solution.file.write = False
    settings.solution.sensors.writePeriod = step
    return settings


def system():
    exu.config.printToConsole = False
    return exu.SystemContainer().AddSystem()


def run(of, step, end, add=None, **given):
    """Histories and body of a run; add(mbs, items): what hangs on it."""
    container = exu.SystemContainer()
    mbs = container.AddSystem()
    items = CreateMultiPhiBody(mbs, of, name="b", **given)
    if add is not None:
        add(mbs, items)
    mbs.Assemble()
    mbs.SolveDynamic(settings(step, end), solverType=TRAPEZOIDAL)
    return body_histories(mbs, items), mbs.variables["multiPhi"]["b"]


def coordinate(mbs, node):
    """A marker on the one coordinate of a node."""
    return mbs.AddMarker(MarkerNodeCoordinate(nodeNumber=node, coordinate=0))

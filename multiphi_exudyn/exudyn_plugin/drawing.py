"""Drawing of a Multi-Phi body in Exudyn's renderer: a polyline of thick bars, and a block for every stop.

    p_j = P_j + scale (w_j.x) d,      stop of contact i at point j:  P_j - scale (gap_i / c) d   where h_i = c w_j

P (k, 3) positions [m]; w (k, n) rows of the deflections [m]; d direction; x (n,) the present displacement.

Exudyn calls the drawing function only when it redraws, so a run without renderer takes no time for it. Contacts whose
direction is not that of one point (between two points, of a force law) have no block. A stop that moves is drawn where
it is without its motion.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import exudyn as exu
import numpy as np
from exudyn import graphics

from multiphi_exudyn.errors import MultiPhiTypeError, MultiPhiValueError
from multiphi_exudyn.exudyn_plugin.body import MultiPhiBody
from multiphi_exudyn.exudyn_plugin.sensors import reconstruct
from multiphi_exudyn.levels.model.model import MultiPhiModel
from multiphi_exudyn.mechanics.arguments import is_real, real_array
from multiphi_exudyn.mechanics.beam import Beam, beam_deflections

__all__ = ["BLOCK", "Drawing", "check_drawing", "graphics_of"]

PARALLEL = 1e-9  # relative: rounding of the coefficients of a contact's direction
SIDES = 12  # of a bar: looks round, costs little
BLOCK = 4.0  # edge of a stop's block in radii of the bars
BODY, OPEN, CLOSED = (0.0, 0.447, 0.698, 1.0), (0.6, 0.6, 0.6, 1.0), (0.835, 0.369, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Drawing:
    """Drawing of a body in Exudyn's renderer: a line of thick bars, and a block for every stop.

        point j                       p_j = P_j + scale (w_j.x) d
        stop of contact i at point j  P_j - scale (gap_i / c) d,  where h_i = c w_j

    Contacts whose direction is not that of one point have no block. A stop that moves is drawn where it is without its
    motion.

    Parameters
    ----------
    positions : array (k, 3)
        P [m], in the order of the line through them; two or more.
    rows : array (k, n)
        w, rows of their deflections [m].
    direction : array (3,)
        d of a positive deflection, a unit vector.
    scale : float, default 1.0
        Scale of deflections and gaps in the picture, > 0.
    radius : float, default 1e-3
        Radius of the bars [m], > 0.

    Raises
    ------
    MultiPhiTypeError
        For values that are not real numbers.
    MultiPhiValueError
        For other shapes, a direction that is not a unit vector, and a scale or a radius that is not finite and > 0.

    Examples
    --------
    >>> import numpy as np
    >>> from multiphi_exudyn.exudyn_plugin import Drawing
    >>> places = [[0.1, 0.0, 0.0], [0.2, 0.0, 0.0], [0.3, 0.0, 0.0]]
    >>> drawing = Drawing(places, rows=np.eye(3), direction=[0.0, 1.0, 0.0], scale=10.0)
    >>> print(drawing.line(np.array([0.0, 0.0, 1e-3]))[2])  # where the tip is drawn [m]
    [0.3  0.01 0.  ]
    """

    positions: np.ndarray
    rows: np.ndarray
    direction: np.ndarray
    scale: float = 1.0
    radius: float = 1e-3

    def __post_init__(self) -> None:
        for field, axes, columns in (("positions", 2, 3), ("rows", 2, None), ("direction", 1, 3)):
            needed = "(3,)" if axes == 1 else f"(k, {columns or 'n'})"
            array = np.array(real_array(f"drawing {field}", getattr(self, field), f"an array {needed}"))
            if array.ndim != axes or (columns and array.shape[-1] != columns):
                raise MultiPhiValueError(f"drawing {field}: got shape {array.shape}, need {needed}")
            object.__setattr__(self, field, array)
        if len(self.positions) != len(self.rows) or len(self.rows) < 2:
            received = f"drawing rows: got {len(self.rows)} rows for {len(self.positions)} positions"
            raise MultiPhiValueError(f"{received}, need one each, at least two")
        if not math.isclose(float(np.linalg.norm(self.direction)), 1.0, rel_tol=PARALLEL):
            raise MultiPhiValueError(f"drawing direction: got {self.direction.tolist()}, need a unit vector")
        for field in ("scale", "radius"):
            value = getattr(self, field)
            if not is_real(value):
                raise MultiPhiTypeError(f"drawing {field}: got {value!r}, need a number")
            if not (math.isfinite(value) and value > 0):
                raise MultiPhiValueError(f"drawing {field}: got {value!r}, need a finite value > 0")

    @classmethod
    def of_beam(cls, beam: Beam, elements: int = 57, scale: float = 1.0, radius: float = 1e-3) -> Drawing:
        """The drawing of ``planar_beam(beam, elements)``: along x, deflections along y, as Exudyn's own planar beams.

        Parameters
        ----------
        beam : Beam
            Beam of the structure.
        elements : int, default 57
            As of ``planar_beam``.
        scale : float, default 1.0
            Scale of deflections and gaps in the picture.
        radius : float, default 1e-3
            Radius of the bars [m].
        """
        x, rows = beam_deflections(beam, elements)
        zero = np.zeros_like(x)
        return cls(np.column_stack((x, zero, zero)), rows, np.array([0.0, 1.0, 0.0]), scale, radius)

    def line(self, deflections: np.ndarray) -> np.ndarray:
        """Positions (k, 3) [m] in the picture for deflections (k,) [m]."""
        return self.positions + self.scale * deflections[:, None] * self.direction

    def stop(self, direction: np.ndarray, gap: float) -> np.ndarray | None:
        """Centre (3,) [m] of the block of a contact h.x + gap, None if h is not the direction of one point."""
        along = np.linalg.norm(self.rows, axis=1) * np.linalg.norm(direction)
        candidates = np.flatnonzero((along > 0) & (np.abs(self.rows @ direction) >= (1 - PARALLEL) * along))
        if not len(candidates):
            return None
        j = candidates[0]
        coefficient = float(self.rows[j] @ direction / (self.rows[j] @ self.rows[j]))
        surface = self.positions[j] - self.scale * gap / coefficient * self.direction
        return np.asarray(surface - math.copysign((1 + BLOCK / 2) * self.radius, coefficient) * self.direction)


def check_drawing(drawing: Any, color: Any, model: MultiPhiModel) -> None:
    """Raise unless ``drawing`` is None or fits the model's structure, and ``color`` is four numbers."""
    shade = real_array("color", color, "four numbers, red, green, blue and opacity")
    if shade.shape != (4,) or not np.all(np.isfinite(shade)):
        raise MultiPhiValueError(f"color: got {color}, need four numbers, red, green, blue and opacity")
    if drawing is None:
        return
    if not isinstance(drawing, Drawing):
        raise MultiPhiTypeError(f"drawing: got {type(drawing).__name__}, need a Drawing or None")
    if drawing.rows.shape[1] != model.structure.n:
        received = f"drawing rows: got {drawing.rows.shape[1]} columns"
        raise MultiPhiValueError(f"{received}, need {model.structure.n}, the structure's degrees of freedom")


def graphics_of(
    body: MultiPhiBody, drawing: Drawing, color: Sequence[float]
) -> Callable[[Any, int], list[dict[str, Any]]]:
    """The graphicsDataUserFunction of the body's object; color: RGBA of its bars, negative for the default."""
    visible = BODY if color[0] < 0 else color
    stops = _stops(body.model, drawing)

    def draw(mbs: Any, itemNumber: int) -> list[dict[str, Any]]:
        deflections, closed = _visible_state(mbs, body, drawing.rows)
        blocks = [_block(centre, bool(closed[i]), drawing.radius) for i, centre in stops.items()]
        return _bars(drawing.line(deflections), drawing.radius, visible) + blocks

    return draw


def _stops(model: MultiPhiModel, drawing: Drawing) -> dict[int, np.ndarray]:
    """Contact's index -> centre (3,) of its block."""
    centres = {
        i: drawing.stop(model.structure.row(contact.direction), contact.gap)
        for i, contact in enumerate(model.contacts)
        if i not in model.base.laws
    }
    return {i: centre for i, centre in centres.items() if centre is not None}


def _visible_state(mbs: Any, body: MultiPhiBody, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Deflections (k,) [m], and which contacts (c,) are closed, in the state on the screen."""
    outputs, visible = exu.OutputVariableType, exu.ConfigurationType.Visualization
    kinds = outputs.Coordinates, outputs.Coordinates_t, outputs.Coordinates_tt
    stored = [np.atleast_1d(mbs.GetNodeOutput(body.items["nGenericODE2"], kind, visible)) for kind in kinds]
    data = np.zeros(0)
    if "nGenericData" in body.items:
        data = np.atleast_1d(mbs.GetNodeOutput(body.items["nGenericData"], outputs.Coordinates, visible))
    time = np.array([mbs.systemData.GetTime(visible)])
    none = np.zeros((body.coordinates.point_count, 1))  # forces on points are not drawn
    displacements, *_ = reconstruct(body, rows, data[None, :], time, np.concatenate(stored)[None, :], none)
    return displacements[:, 0], body.coordinates.layout.states(data) > 0


def _bars(line: np.ndarray, radius: float, color: Sequence[float]) -> list[dict[str, Any]]:
    return [
        graphics.Cylinder(a.tolist(), (b - a).tolist(), radius, color=list(color), nTiles=SIDES)
        for a, b in pairwise(line)
    ]


def _block(centre: np.ndarray, closed: bool, radius: float) -> dict[str, Any]:
    edge = [BLOCK * radius] * 3
    block: dict[str, Any] = graphics.Brick(centre.tolist(), edge, color=list(CLOSED if closed else OPEN))
    return block

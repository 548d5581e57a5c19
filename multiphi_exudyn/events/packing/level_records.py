"""Records of levels, their responses, exits and signals, and of the base, in buffers (arrays.py)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeAlias

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.arrays import Batch, Buffers
from multiphi_exudyn.events.excitation.excitation import Excitation
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.packing.level_parts import base_parts, level_parts, powers
from multiphi_exudyn.events.transitions.defect_forms import factor, struck_defects
from multiphi_exudyn.events.transitions.exit_table import ExitTable
from multiphi_exudyn.events.transitions.exits import asked_state, signal_row, signals_of
from multiphi_exudyn.events.transitions.state import Row
from multiphi_exudyn.events.transitions.work_forms import DrivenForms, driven_forms, primitive, swings
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.mathematics.compiling.compiled import entry
from multiphi_exudyn.mathematics.response import response_arrays
from multiphi_exudyn.mathematics.response.basis_arrays import describe_basis
from multiphi_exudyn.mathematics.response.exponentials import Exponentials
from multiphi_exudyn.mechanics.elements.element import Exit, Share

__all__ = ["put_base", "put_level", "put_powers", "put_signal", "put_sizes", "put_strain", "put_struck"]

Put: TypeAlias = Callable[[str, object], int]  # Buffers.put, or Batch.put

describe = entry(describe_basis)


def put_base(buffers: Buffers, base: ModalBase, excitation: Excitation) -> int:
    """Write the record of the base as a level in which all contacts are open and runs start, and return it."""
    elements, parts = int(buffers.ints[a.ELEMENTS]), base_parts(base, excitation)
    batch = Batch(buffers)
    slots = {
        a.MODES: base.modes.count,
        a.STATES: batch.put("ints", np.zeros(elements, int)),
        **_frequencies(batch, base.modes.omega),
        **{slot: batch.put("numbers", values) for slot, values in parts.items()},
    }
    record = _record(batch, slots)
    batch.write()
    return record


def put_level(buffers: Buffers, level: LoadedLevel, number: int, exits: ExitTable, kept: np.ndarray) -> int:
    """Write the record of a level with a number, and of its exits, those of the table that are kept (e,)."""
    own, modal, parts = level.level, level.modal, level_parts(level)
    batch, firsts = Batch(buffers), exits.firsts(kept)
    put = batch.put
    basis = _put_basis(batch, level.response.basis)
    slots = {
        a.NUMBER: number,
        a.MODES: modal.modes,
        a.STATES: put("ints", level.states),
        a.RESPONSE: _put_response(batch, level, basis),
        a.FREE_SIZES: put("numbers", _free_sizes(level)) if buffers.ints[a.PRESCRIBED] else -1,
        a.STRUCK_DEFECTS: 0 if buffers.ints[a.JUDGED] else -1,
        a.FORCE: put("numbers", level.asymptotic.drive) if level.driven else -1,
        a.EXITS: _put_exits(batch, level, exits, kept),
        a.EXIT_COUNT: int(firsts[-1]),
        a.FIRST_EXITS: put("ints", firsts),
        **_frequencies(batch, modal.omega),
        a.HIGHEST_FREQUENCY: put("numbers", [max(own.highest_frequency, level.excitation.highest_frequency)]),
        a.FOLLOW_COUNT: len(parts[a.FOLLOWS]),
        **{slot: put("numbers", values) for slot, values in parts.items()},
    }
    record = _record(batch, slots)
    batch.write()
    describe(*buffers.all, basis)
    return record


def put_powers(buffers: Buffers, record: int, level: LoadedLevel, carriers: Mapping[complex, int]) -> None:
    """Add the powers of damping, of varying loads and of friction, and their primitives, to the record of a level."""
    damping, varying, rubbing, pairs = powers(level)
    damping, friction = (damping + damping.T) / 2, np.concatenate([rubbing, pairs], axis=None)
    slots = {
        a.DISSIPATION: buffers.put("numbers", damping),
        a.POWER: buffers.put("numbers", varying),
        a.RUBBING: buffers.put("numbers", friction) if friction.any() else -1,
        a.RUBBINGS: len(pairs),
        **_put_dissipated(buffers, None if len(pairs) else primitive(level, damping)),
        a.SWINGS: buffers.put("waves", swings(level, varying)) if level.excitation.channels else -1,
        a.DRIVEN: -1,
    }
    if slots[a.DISSIPATED] >= 0 and (forms := driven_forms(level, damping, varying, carriers)) is not None:
        slots[a.DRIVEN] = _put_driven(buffers, forms)
    for slot, value in slots.items():
        buffers.ints[record + slot] = value


def _put_dissipated(buffers: Buffers, form: np.ndarray | None) -> dict[int, int]:
    """Write the form (2 r, 2 r) of the work of damping, and the range of modes that are coupled in it."""
    if form is None:
        return {a.DISSIPATED: -1}
    r = len(form) // 2
    reached = response_arrays.reached_modes([form[:r, :r], form[:r, r:], form[r:, :r], form[r:, r:]])
    return {a.DISSIPATED: buffers.put("numbers", form), a.DISSIPATED_MODES: buffers.put("ints", reached)}


def _put_driven(buffers: Buffers, forms: DrivenForms) -> int:
    """Write the record of the forms of forced responses."""
    arrays = (forms.response, *forms.changing, *forms.lasting, forms.nodes, forms.weights)
    places = [buffers.put("numbers", array) for array in arrays]
    rates = buffers.put("waves", list(forms.carriers))
    parts = [1 + bool(rate.imag) for rate in forms.carriers]  # real, and imaginary
    carriers = np.column_stack([list(forms.carriers.values()), rates + np.arange(len(parts)), parts]).ravel().tolist()
    counts = [len(forms.lasting[0]), len(forms.nodes), len(forms.carriers)]
    return buffers.put("ints", [*counts, *places, *carriers])


def put_sizes(buffers: Buffers, record: int, level: LoadedLevel) -> None:
    """Add the factors of |y| and of the work of static loads on y to the record of a level."""
    motion = np.column_stack([level.level.vectors, level.asymptotic.configuration])
    n = motion.shape[1]
    factors = np.zeros((n + 1, n))
    factors[-1] = level.excitation.static @ motion
    factors[:-1] = factor(motion)
    buffers.ints[record + a.SIZES] = buffers.put("numbers", factors)


def put_struck(buffers: Buffers, record: int, level: LoadedLevel) -> None:
    """Add the defects of contacts that are struck and open again to the record of a level."""
    buffers.ints[record + a.STRUCK_DEFECTS] = buffers.put("numbers", struck_defects(level))


def put_strain(buffers: Buffers, record: int, level: LoadedLevel) -> None:
    """Add the strain energy to the record of a level."""
    form = level.strain_form
    rows = np.column_stack([form.weights, form.rows, form.offsets])
    buffers.ints[record + a.STRAIN_ROWS] = len(rows)
    values = np.concatenate([[form.constant], form.linear, rows], axis=None)
    buffers.ints[record + a.STRAIN_FORM] = buffers.put("numbers", values)


def put_signal(put: Put, level: LoadedLevel, row: Row) -> list[int]:
    """Write a signal, and return its record."""
    table = np.concatenate([row.position, row.rate, [row.constant]])[None, :]
    return [int(part) for part in _put_signals(put, level, table)[0]]


def _put_signals(put: Put, level: LoadedLevel, table: np.ndarray) -> np.ndarray:
    """Write signals, and return their records (e, 3) (exits.signals_of)."""
    n, r, shapes = level.width, level.modal.modes, level.response.shapes
    waves, moves, records = table[:, :r] @ shapes, table[:, n:-1].any(axis=1), np.empty((len(table), 3), int)
    if moves.any():
        waves = np.hstack([waves, table[:, n : n + r] @ shapes])
    steps = np.arange(len(table))
    records[:, a.ROW] = put("numbers", table) + table.shape[1] * steps
    records[:, a.WAVE] = put("waves", waves) + waves.shape[1] * steps
    records[:, a.RATED] = moves
    return records


def _record(batch: Batch, slots: dict[int, int]) -> int:
    """Write a level's record; without others its speed rows are the gap rows."""
    record = [0] * a.LEVEL_INTS
    for slot, value in {a.CARRIED: -1, a.MOBILITY: -1, a.SPEEDS: slots[a.GAPS], **slots}.items():
        record[slot] = value
    return batch.put("ints", record)


def _frequencies(batch: Batch, omega: np.ndarray) -> dict[int, int]:
    """Write omega (r,) and its inverses, zero where omega is zero."""
    periods = 1 / omega if omega.all() else np.divide(1.0, omega, out=np.zeros(len(omega)), where=omega > 0)
    return {a.FREQUENCIES: batch.put("numbers", omega), a.PERIODS: batch.put("numbers", periods)}


def _put_response(batch: Batch, level: LoadedLevel, basis: int) -> int:
    """Write the record of a level's response (response_arrays.py)."""
    response, modal, put = level.response, level.modal, batch.put
    maps = (response.from_displacement, response.from_velocity, response.from_force, response.shapes.T)
    reached = put("ints", response_arrays.reached_modes(maps))
    places = [put("waves", values) for values in maps]
    places += [put("numbers", modal.squares), put("numbers", modal.damping.diagonal() / 2)]
    chains = [len(response.chains)]
    for chain in response.chains:
        parts = chain.mixing, chain.shapes.T, chain.pushes
        chains += [len(chain.mixing), *(put("waves", part) for part in parts)]
    places += [put("ints", response.alone), put("ints", response.poles), put("ints", chains)]
    return put("ints", [modal.modes, basis, reached, *places])


def _free_sizes(level: LoadedLevel) -> np.ndarray:
    """Return |A|, |B|, |P| (3, p, r) of a level's response."""
    response = level.response
    return np.abs([response.from_displacement, response.from_velocity, response.from_force])


def _put_basis(batch: Batch, basis: Exponentials) -> int:
    """Write the record of a basis (basis_arrays.py), whose description follows."""
    put = batch.put
    powers, rates, scales = put("ints", basis.powers), put("waves", basis.rates), put("numbers", [basis.unit, 0, 0])
    return put("ints", [len(basis.rates), powers, rates, scales, 0, 0])


def _put_exits(batch: Batch, level: LoadedLevel, exits: ExitTable, kept: np.ndarray) -> int:
    """Write the records of the exits of a level, those of the table that are kept (e,)."""
    signals = _put_signals(batch.put, level, signals_of(level, exits.shares(kept)))
    table = np.full((len(signals), a.EXIT_INTS), -1)
    table[:, : a.SIGNAL], table[:, a.SIGNAL : a.ENTERED] = exits.described[kept], signals
    for k, exit_ in exits.turning(kept):
        table[k, a.TURN :] = _turn(batch.put, level, int(table[k, 0]), exit_)
    return batch.put("ints", table)


def _turn(put: Put, level: LoadedLevel, element: int, exit_: Exit) -> list[int]:
    """Return the signal of the velocity on which an exit's requested state depends, and the two states."""
    assert exit_.turn is not None, "only exits that turn have one"
    speed = signal_row(level, element, Exit(exit_.asked, further=(Share(exit_.turn.link, rate=1.0),)))
    asked = [asked_state(level, element, Exit(name)) for name in (exit_.turn.forward, exit_.turn.backward)]
    return [*put_signal(put, level, speed), *asked]

"""Records of levels, their responses, exits and signals, and of the base, in buffers (arrays.py)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.arrays import Buffers
from multiphi_exudyn.events.excitation.excitation import Excitation
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.packing.level_parts import base_parts, channel_parts, level_numbers, powers
from multiphi_exudyn.events.packing.level_writing import project_signal, record_sizes, write_record
from multiphi_exudyn.events.transitions.defect_forms import factor, struck_defects
from multiphi_exudyn.events.transitions.exit_table import ExitTable
from multiphi_exudyn.events.transitions.exits import asked_state, signal_row
from multiphi_exudyn.events.transitions.state import Row
from multiphi_exudyn.events.transitions.work_forms import DrivenForms, driven_forms, primitive, swings
from multiphi_exudyn.levels.base.modal_base import ModalBase
from multiphi_exudyn.mathematics.response import response_arrays
from multiphi_exudyn.mathematics.response.basis_arrays import SIZE
from multiphi_exudyn.mathematics.response.free_response import ModalResponse
from multiphi_exudyn.mathematics.response.response_arrays import FREE
from multiphi_exudyn.mechanics.elements.element import Exit, Share

__all__ = ["put_base", "put_level", "put_powers", "put_signal", "put_sizes", "put_strain", "put_struck"]


def put_base(buffers: Buffers, base: ModalBase, excitation: Excitation) -> int:
    """Write the record of the base as a level in which all contacts are open and runs start, and return it."""
    put, omega = buffers.put, base.modes.omega
    record = [0] * a.LEVEL_INTS
    record[a.MODES], record[a.CARRIED], record[a.MOBILITY] = base.modes.count, -1, -1
    record[a.STATES] = put("ints", np.zeros(int(buffers.ints[a.ELEMENTS]), int))
    record[a.FREQUENCIES] = put("numbers", omega)
    record[a.PERIODS] = put("numbers", np.divide(1.0, omega, out=np.zeros(len(omega)), where=omega > 0))
    for slot, values in base_parts(base, excitation).items():
        record[slot] = put("numbers", values)
    record[a.SPEEDS] = record[a.GAPS]
    return put("ints", record)


def put_level(buffers: Buffers, level: LoadedLevel, number: int, exits: ExitTable, kept: int) -> int:
    """Write the record of a level with a number, and of its exits, of which there are ``kept``; return the record."""
    own, modal, response, form = level.level, level.modal, level.response, level.potential_form
    (links, n), r, p, powers = own.gap_rows.shape, modal.modes, len(response.basis.rates), response.basis.powers
    sizes = number, r, n - r, p, links, len(own.indices), len(exits.described), kept, len(form.follows)
    described = [*sizes, _put_chains(buffers, response), *level.states, *own.indices]
    rates = buffers.put("waves", response.basis.rates)
    buffers.put("waves", response.maps)  # right behind
    rated = int(exits.rated or np.count_nonzero(own.force_rate_rows) > 0)
    signals = buffers.take("waves", kept * (1 + rated) * p)
    ints, numbers = record_sizes(len(level.states), r, n - r, p, links, kept, len(form.follows))
    free_sizes = 3 * p * r if buffers.ints[a.PRESCRIBED] else 0
    record, at = buffers.take("ints", ints), buffers.take("numbers", numbers + free_sizes)
    write_record(
        *buffers.all, np.concatenate([np.array(described), powers, response.alone, response.poles]),
        level_numbers(level), exits.described.ravel(), exits.shares.links, exits.shares.numbers, record, at, rates,
        signals, rated,
    )  # fmt: skip
    for slot, values in channel_parts(level).items():
        place = buffers.put("numbers", values)
        buffers.ints[record + slot] = place
    for turning, element, exit_ in exits.turning(level.states):
        _put_turn(buffers, record, turning, level, element, exit_)
    return record


def _put_chains(buffers: Buffers, response: ModalResponse) -> int:
    """Write the chains of a response (response_arrays.py), and return where they begin, -1 without any."""
    if not response.chains:
        return -1
    chains = [len(response.chains)]
    for chain in response.chains:
        parts = chain.mixing, chain.shapes.T, chain.pushes
        chains += [len(chain.mixing), *(buffers.put("waves", part) for part in parts)]
    return buffers.put("ints", chains)


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


def put_signal(buffers: Buffers, record: int, row: Row) -> int:
    """Write a signal of a level with this record, and return the signal's record."""
    n, p = len(row.position), int(buffers.ints[buffers.ints[buffers.ints[record + a.RESPONSE] + FREE] + SIZE])
    place = buffers.put("numbers", np.concatenate([row.position, row.rate, [row.constant]]))
    wave = buffers.take("waves", 2 * p)
    rated = project_signal(*buffers.all, int(buffers.ints[record + a.RESPONSE]), place, wave, n)
    return buffers.put("ints", [place, wave, rated])


def _put_turn(buffers: Buffers, record: int, number: int, level: LoadedLevel, element: int, exit_: Exit) -> None:
    """Add to an exit the signal of the velocity on which its requested state depends, and the two states."""
    assert exit_.turn is not None, "only exits that turn have one"
    speed = signal_row(level, element, Exit(exit_.asked, further=(Share(exit_.turn.link, rate=1.0),)))
    asked = [asked_state(level, element, Exit(name)) for name in (exit_.turn.forward, exit_.turn.backward)]
    signal = put_signal(buffers, record, speed)
    place = int(buffers.ints[record + a.EXITS]) + number * a.EXIT_INTS
    buffers.ints[place + a.TURN : place + a.EXIT_INTS] = [*buffers.ints[signal : signal + 3], *asked]

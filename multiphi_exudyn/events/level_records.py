"""Records of levels, their responses, exits and signals, and of the base, in buffers (arrays.py)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from multiphi_exudyn.events import arrays as a
from multiphi_exudyn.events.arrays import Buffers
from multiphi_exudyn.events.excitation import Excitation
from multiphi_exudyn.events.exits import asked_state, exits_of, signal_row, signal_table
from multiphi_exudyn.events.level_parts import base_parts, level_parts, powers, primitive
from multiphi_exudyn.events.loaded_level import LoadedLevel
from multiphi_exudyn.events.state import Row
from multiphi_exudyn.levels.level import Level
from multiphi_exudyn.levels.modal_base import ModalBase
from multiphi_exudyn.mathematics import basis_arrays, response_arrays
from multiphi_exudyn.mathematics.exponentials import Exponentials
from multiphi_exudyn.mechanics.element import Exit, Share

__all__ = ["put_base", "put_level", "put_powers", "put_signal"]


def put_base(buffers: Buffers, base: ModalBase, excitation: Excitation) -> int:
    """The record of the base as a level in which all contacts are open, where runs start."""
    elements, parts = int(buffers.ints[a.ELEMENTS]), base_parts(base, excitation)
    given = {
        a.MODES: base.modes.count,
        a.STATES: buffers.take("ints", elements),
        **_frequencies(buffers, base.modes.omega),
        **{slot: buffers.put("numbers", values) for slot, values in parts.items()},
    }
    return _record(buffers, given)


def put_level(buffers: Buffers, level: LoadedLevel, number: int) -> int:
    """The record of a level with a number, whose exits are all watched."""
    own, modal, put, parts, exits = level.level, level.modal, buffers.put, level_parts(level), exits_of(level)
    firsts = np.searchsorted([i for i, _ in exits], range(len(level.states) + 1))
    given = {
        a.NUMBER: number,
        a.MODES: modal.modes,
        a.STATES: put("ints", level.states),
        a.RESPONSE: _put_response(buffers, modal),
        a.FORCE: put("numbers", level.asymptotic.drive) if level.driven else -1,
        a.EXITS: _put_exits(buffers, level, exits),
        a.EXIT_COUNT: len(exits),
        a.FIRST_EXITS: put("ints", firsts),
        a.WATCHED: put("ints", range(len(exits))),
        a.WATCHED_COUNT: len(exits),
        **_frequencies(buffers, modal.omega),
        a.HIGHEST_FREQUENCY: put("numbers", [own.highest_frequency]),
        a.FOLLOW_COUNT: len(parts[a.FOLLOWS]),
        **{slot: put("numbers", values) for slot, values in parts.items()},
    }
    return _record(buffers, given)


def put_powers(buffers: Buffers, record: int, level: LoadedLevel) -> None:
    """Give the record of a level the power of damping, of what varies and of friction."""
    damping, varying, rubbing, pairs = powers(level)
    dissipated = primitive(level.modal, damping)
    given = (damping + damping.T) / 2, varying, np.append(rubbing, pairs)
    places = [buffers.put("numbers", values) for values in given]
    places += [len(pairs), -1 if dissipated is None else buffers.put("numbers", dissipated)]
    for slot, place in zip((a.DISSIPATION, a.POWER, a.RUBBING, a.RUBBINGS, a.DISSIPATED), places, strict=True):
        buffers.ints[record + slot] = place


def put_signal(buffers: Buffers, level: LoadedLevel, row: Row) -> list[int]:
    """The record of a signal."""
    return _put_signals(buffers, level, (row.position[None, :], row.rate[None, :], np.array([row.constant])))[0]


def _put_signals(
    buffers: Buffers, level: LoadedLevel, table: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> list[list[int]]:
    """The records of signals (exits.signal_table)."""
    position, rate, constant = table
    r, shapes = level.modal.modes, level.modal.response.shapes
    numbers = np.hstack([position, rate, constant[:, None]])
    waves = np.hstack([position[:, :r] @ shapes, rate[:, :r] @ shapes])
    at, wave, rates = buffers.put("numbers", numbers), buffers.put("waves", waves), np.any(rate, axis=1).tolist()
    count, width = numbers.shape[1], waves.shape[1]
    return [[at + k * count, wave + k * width, int(moves)] for k, moves in enumerate(rates)]


def _record(buffers: Buffers, given: dict[int, int]) -> int:
    """A level's record; where it says nothing else, speeds are those of gaps."""
    record = buffers.take("ints", a.LEVEL_INTS)
    for slot, value in {a.CARRIED: -1, a.MOBILITY: -1, a.SPEEDS: given[a.GAPS], **given}.items():
        buffers.ints[record + slot] = value
    return record


def _frequencies(buffers: Buffers, omega: np.ndarray) -> dict[int, int]:
    """Where omega (r,) stands, and its inverses, zero where it is."""
    periods = np.divide(1.0, omega, out=np.zeros(len(omega)), where=omega > 0)
    return {a.FREQUENCIES: buffers.put("numbers", omega), a.PERIODS: buffers.put("numbers", periods)}


def _put_response(buffers: Buffers, level: Level) -> int:
    """The record of a level's response (response_arrays.py)."""
    response, put = level.response, buffers.put
    maps = (response.from_displacement, response.from_velocity, response.from_force, response.shapes.T)
    basis, reached = _put_basis(buffers, response.basis), put("ints", response_arrays.reached_modes(maps))
    places = [put("waves", values) for values in maps]
    places += [put("numbers", level.squares), put("numbers", np.diagonal(level.damping) / 2)]
    chains = [len(response.chains)]
    for chain in response.chains:
        parts = chain.mixing, chain.shapes.T, chain.pushes
        chains += [len(chain.mixing), *(put("waves", part) for part in parts)]
    places += [put("ints", response.alone), put("ints", response.poles), put("ints", chains)]
    return put("ints", [level.modes, basis, reached, *places])


def _put_basis(buffers: Buffers, basis: Exponentials) -> int:
    """The record of a basis (basis_arrays.py)."""
    put = buffers.put
    powers, rates, scales = put("ints", basis.powers), put("waves", basis.rates), put("numbers", [basis.unit, 0, 0])
    record = put("ints", [len(basis.rates), powers, rates, scales, 0, 0])
    basis_arrays.describe_basis(*buffers.all, record)
    return record


def _put_exits(buffers: Buffers, level: LoadedLevel, exits: Sequence[tuple[int, Exit]]) -> int:
    """Records of the exits of a level."""
    signals, table = _put_signals(buffers, level, signal_table(level, exits)), list[list[int]]()
    for signal, (i, exit_) in zip(signals, exits, strict=True):
        asked = asked_state(level, i, exit_)
        table.append([i, asked, exit_.firmness, *signal, -1, *_turn(buffers, level, i, exit_)])
    return buffers.put("ints", np.array(table, dtype=int))


def _turn(buffers: Buffers, level: LoadedLevel, element: int, exit_: Exit) -> list[int]:
    """The signal of the speed that may turn an exit, and the states that it asks for then."""
    if exit_.turn is None:
        return [-1] * (a.EXIT_INTS - a.TURN)
    speed = signal_row(level, element, Exit(exit_.asked, further=(Share(exit_.turn.link, rate=1.0),)))
    asked = [asked_state(level, element, Exit(name)) for name in (exit_.turn.forward, exit_.turn.backward)]
    return [*put_signal(buffers, level, speed), *asked]

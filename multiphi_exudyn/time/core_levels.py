"""Core levels: the levels of a model under the loads of a run, as the core takes them, each built on first use."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

import multiphi_exudyn._core as core
from multiphi_exudyn.events.excitation.loaded_level import LoadedLevel
from multiphi_exudyn.events.transitions.loaded_levels import LoadedLevels
from multiphi_exudyn.levels.core_model import core_model
from multiphi_exudyn.mathematics.blas_threads import one_blas_thread

__all__ = ["core_excitation", "core_levels", "level_data"]


MOST_BYTES = 2**29  # of the levels that are kept between runs: half of what a model may keep


def core_levels(levels: LoadedLevels) -> core.Levels:
    """Return the core's levels for the motions of these, which build them and keep them for later runs."""
    if levels.core is None or levels.core.bytes > MOST_BYTES:
        levels.core = _made(levels)
    made: core.Levels = levels.core
    return made


def _made(levels: LoadedLevels) -> core.Levels:
    @one_blas_thread()
    def build(states: Sequence[int]) -> core.LevelData:
        return level_data(levels.level(states))

    return core.Levels(core_model(levels.model), core_excitation(levels), build)


def core_excitation(levels: LoadedLevels) -> core.Excitation:
    """Return the static and varying loads of levels, from the start of their motions until these end."""
    excitation = levels.excitation
    return core.Excitation(
        static_load=excitation.static,
        patterns=excitation.patterns,
        stops=excitation.stops,
        functions=[(history.breaks, history.rates, history.coefficients) for history in excitation.histories],
        start=levels.drive.time,
        until=levels.until,
        highest_frequency=excitation.highest_frequency,
        is_isolated=levels.isolated,
    )


def level_data(level: LoadedLevel) -> core.LevelData:
    """Return what is known of a level in base coordinates and in xi; the core derives the rest."""
    own, modal, channels, rest = level.level, level.modal, level.channels, level.asymptotic
    return core.LevelData(
        key=level.states,
        links=own.indices,
        squares=modal.squares,
        computed=modal.computed,
        damping_matrix=modal.damping_matrix,
        coupling=modal.coupling,
        damping=modal.damping,
        modes=modal.inertial,
        bending=np.zeros((0, 0)) if modal.bending is None else modal.bending,
        configuration=rest.configuration,
        drive=rest.drive,
        static_drive=level.alone.asymptotic.drive,
        load=rest.load,
        strain=rest.strain,
        stored=level.stored,
        gap_rows=own.gap_rows,
        gap_constants=level.gap_constants,
        velocity_rows=own.gap_rows if own is modal else own.speed_rows,
        force_rows=own.force_rows,
        force_velocity_rows=own.force_rate_rows,
        forces=rest.forces,
        channel_force=channels.force,
        channel_force_rate=channels.force_rate,
        channel_shapes=channels.shapes,
        carried=channels.carried,
        duration=level.alone.lasting,
    )

"""Levels, transitions, energies and inputs of the core are what matrices and functions say, of scenes of all kinds."""

import functools
import itertools
import math
import pickle
from typing import NamedTuple

import numpy as np
import pytest
from campaign_scenes import KINDS, scene_of
from numpy.testing import assert_array_equal

from multiphi_exudyn import MultiPhiError
from multiphi_exudyn import _core as core
from multiphi_exudyn.errors import NumericalFailure
from multiphi_exudyn.levels.core_model import RULES, core_model
from multiphi_exudyn.mathematics.orthonormal import without
from multiphi_exudyn.time.excitation import Excitation
from multiphi_exudyn.time.loaded_levels import LoadedLevels

ROUND_OFF = 1e-12  # of the size of the terms
NUMBERS = range(2)  # scenes of every kind
MOST_LEVELS = 6  # of a scene


def near(got, wanted, size=0.0):
    """``got`` is ``wanted`` but for round-off of terms of this size, of the largest value at least."""
    got, wanted = np.asarray(got), np.asarray(wanted)
    assert got.shape == wanted.shape
    allowed = ROUND_OFF * np.maximum(size, np.max(np.abs(wanted[~np.isnan(wanted)]), initial=0.0))
    apart = np.abs(got - wanted)
    same = (apart <= allowed) | (np.isnan(got) & np.isnan(wanted))
    assert np.all(same), (np.max(apart), np.min(np.broadcast_to(allowed, apart.shape)[~same]))


class Case(NamedTuple):
    """A scene's levels in Python and in the core, and the states in which a level exists."""

    levels: LoadedLevels
    core: core.Levels
    keys: list[tuple[int, ...]]
    random: np.random.Generator

    def pairs(self):
        return list(itertools.permutations(self.keys, 2))[:12]


@functools.lru_cache(maxsize=4)
def case_of(kind, number):
    scene = scene_of(kind, number)
    model = scene.model
    excitation = Excitation.of(model, scene.loads, scene.t_end)
    levels = LoadedLevels.under(model, excitation, 0.0, scene.t_end, lasting=scene.t_end)
    random = np.random.default_rng([number, *kind.encode()])
    return Case(levels, levels.in_core, _keys(levels, random), random)


def _keys(levels, random):
    """States reached from the first ones by the changes that elements may request; some have no level."""
    elements = levels.model.contacts
    waiting, found = [(0,) * len(elements)], []
    while waiting and len(found) < MOST_LEVELS:
        key = waiting.pop(0)
        try:
            levels.level(key)
        except NumericalFailure:
            continue
        found.append(key)
        for i, element in enumerate(elements):
            names = [state.name for state in element.states]
            for exit_ in element.states[key[i]].exits:
                reached = (*key[:i], names.index(exit_.asked), *key[i + 1 :])
                if reached not in found + waiting and _is_possible(levels.model, reached):
                    waiting.insert(int(random.integers(len(waiting) + 1)), reached)
    return found


def _is_possible(model, key):
    links = model.active_links(key)
    return model.base.independent([k for k in links if model.links[k].rigid])


@pytest.fixture(params=[(kind, number) for kind in KINDS for number in NUMBERS], ids=lambda p: f"{p[0]}-{p[1]}")
def case(request):
    try:
        return case_of(*request.param)
    except MultiPhiError as error:
        pytest.skip(str(error))


class TestLevel:
    def test_moves_as_its_matrices_say(self, case):
        for key in case.keys:
            level, loaded = case.core.level(key), case.levels.level(key)
            modal, r, n = loaded.modal, level.modes, level.modes + level.channels
            assert level.key == key
            assert (r, n) == (modal.modes, loaded.width)
            stiffness = np.diag(modal.squares) + modal.coupling
            near(level.displacement_acceleration, np.hstack([-stiffness, loaded.channels.force]))
            near(level.velocity_acceleration, np.hstack([-modal.damping_matrix, loaded.channels.force_rate]))
            near(level.omega[modal.squares > 0], np.sqrt(modal.squares[modal.squares > 0]))
            held = loaded.channels.force[:, loaded.excitation.prescribed :]
            assert level.drives_free_modes == (loaded.driven or bool(np.any(held)))

    def test_has_the_gaps_of_its_configuration(self, case):
        """h.y + gap - s w of every link, y = Psi eta + y_inf + R w."""
        for key in case.keys:
            level, base = case.core.level(key), case.levels.model.base
            shapes = np.hstack([level.shapes, level.channel_shapes])
            stops = np.hstack([np.zeros((len(base.links), level.modes)), case.levels.excitation.stops])
            sizes = np.abs(base.directions.T) @ np.abs(shapes) + np.abs(stops)
            near(level.gap_rows, base.directions.T @ shapes - stops, np.max(sizes, initial=1.0))
            rest = np.abs(base.directions.T) @ np.abs(level.configuration) + np.abs(base.gaps)
            near(level.gap_constants, base.gaps_at(level.configuration, base.gaps), 10 * np.max(rest, initial=0.0))

    def test_has_guards(self, case):
        for key in case.keys:
            level, loaded = case.core.level(key), case.levels.level(key)
            exits = loaded.exits
            assert len(level.guards) == len(exits)
            for guard, (i, exit_) in zip(level.guards, exits, strict=True):
                assert (guard.element, guard.target) == (i, loaded.asked_state(i, exit_))
                position, rate, constant = _signal(loaded, i, exit_)
                assert guard.rule == RULES[exit_.firmness]
                near(guard.signal.displacement, position)
                near(guard.signal.velocity, rate)
                near(guard.signal.constant, sum(constant), np.max(np.abs([*position, *constant]), initial=0.0))
                assert (guard.by_velocity is None) == (exit_.turn is None)
            firsts = [sum(element < i for element, _ in exits) for i in range(len(key))]
            assert [level.first_guard(i) for i in range(len(key))] == firsts

    def test_has_defects_of_struck_contacts(self, case):
        """|w / Omega|^2 of a unit impulse: V V^T h, without its part along h and along what closed contacts prevent."""
        for key in case.keys:
            level, loaded = case.core.level(key), case.levels.level(key)
            base, modes = loaded.level.base, loaded.modal.vectors
            held = [k for k in loaded.level.indices if base.links[k].rigid]
            rough = any(element.further or element.held for element in base.contacts)
            for i, element in enumerate(base.contacts):
                if not element.rigid or rough:
                    assert np.isnan(level.struck_defects[i])
                    continue
                given = base.directions[:, [i]]
                moved = _allowed(base, held, modes @ (modes.T @ given))
                across = _allowed(base, held, given)
                if np.any(across):
                    moved = moved - across * (np.sum(across * moved) / np.sum(across**2))
                size = (np.linalg.norm(given) * np.max(base.periods, initial=0.0)) ** 2
                near(level.struck_defects[i], np.sum((base.periods[:, None] * moved) ** 2), size)


def _signal(loaded, element, exit_):
    """Rows (n,) of xi and xi' and the constant terms of s = gap q + rate q' + force lambda + constant."""
    own, links = loaded.level, loaded.base.link_indices[element]
    position, rate, constants = np.zeros(loaded.width), np.zeros(loaded.width), [exit_.constant]
    for share in exit_.shares:
        link = links[share.link]
        position += share.gap * own.gap_rows[link]
        rate += share.rate * own.gap_rows[link]
        constants.append(share.gap * loaded.gap_constants[link])
        if share.force:
            k = own.indices.index(link)
            position += share.force * own.force_rows[k]
            rate += share.force * own.force_rate_rows[k]
            constants.append(share.force * loaded.asymptotic.forces[k])
    return position, rate, constants


def _allowed(base, held, motion):
    return without(base.directions[:, held], motion) if held else motion


class TestEnergies:
    def test_of_states(self, case):
        for key in case.keys:
            level, loaded = case.core.level(key), case.levels.level(key)
            n = level.modes + level.channels
            x, v = case.random.normal(size=(2, n))
            kinetic, potential, work, strain = core.energies(level, x, v)
            w, y = x[level.modes :], loaded.configuration(x)
            size = self.size(loaded, x)
            near(kinetic, loaded.kinetic(v))
            near(potential, loaded.potential(x), size)
            near(work, float((loaded.excitation.patterns @ w) @ y), size)
            near(strain, float(loaded.strain(x)), size)

    def size(self, loaded, x):
        """The energies of all parts of a displacement by itself, an upper bound of the terms of every energy."""
        base = loaded.level.base
        y = np.abs(loaded.level.vectors) @ np.abs(x) + np.abs(loaded.asymptotic.configuration)
        springs = np.abs(base.springs) @ (np.abs(loaded.level.gap_rows) @ np.abs(x) + np.abs(loaded.gap_constants)) ** 2
        w = np.abs(x[loaded.modal.modes :])
        loads = np.abs(loaded.excitation.static) + np.abs(base.preload) + np.abs(loaded.asymptotic.load)
        follows = np.sum((np.abs(loaded.follows) @ np.append(np.abs(x), 1.0)) ** 2)
        own = np.abs(loaded.level.squares) @ x**2
        bent = base.squares @ y**2
        return bent + springs + own + follows + y @ loads + (np.abs(loaded.excitation.patterns) @ w) @ y

    def test_of_the_base(self, case):
        base, excitation = case.levels.model.base, case.levels.excitation
        m, q = base.modes.count, excitation.channels
        x, v = case.random.normal(size=(2, m + q))
        y, w = x[:m], x[m:]
        kinetic, potential, work, _ = core.energies(case.core.base, x, v)
        near(kinetic, 0.5 * v[:m] @ v[:m])
        near(work, (excitation.patterns @ w) @ y, np.abs(excitation.patterns @ w) @ np.abs(y))
        terms = [base.energy_offset, *(-(base.preload + excitation.static) * y), *(0.5 * base.squares * y**2), -work]
        near(potential, sum(terms), sum(map(abs, terms)))
        near(case.core.base.patterns[:, :m], excitation.patterns.T)

    def test_lost_at_a_change(self, case):
        for source, target in case.pairs():
            states = [case.random.normal(size=(2, case.levels.level(key).width)) for key in (source, target)]
            got = core.losses(case.core.level(source), *states[0], case.core.level(target), *states[1], 0.25)
            before, after = (case.levels.level(key) for key in (source, target))
            damped, dropped = self.springs(before, states[0][0], source, target)
            strain = before.potential(states[0][0]) - after.potential(states[1][0]) - damped - dropped
            kinetic = float(before.kinetic(states[0][1]) - after.kinetic(states[1][1])) - 0.25
            size = self.size(before, states[0][0]) + self.size(after, states[1][0])
            near(got, [0.0, kinetic, strain, 0.0, damped, dropped], size)

    @staticmethod
    def acting(model, element, state):
        """Links of an element that act in a state."""
        return [model.link_indices[element][k] for k in model.contacts[element].states[state].holds]

    def springs(self, level, x, source, target):
        """Energies of the springs of viscous contacts that open or close, and of friction that begins to slip."""
        gaps, model = level.level.gap_rows @ x + level.gap_constants, level.level.base
        damped = dropped = 0.0
        for i, element in enumerate(model.contacts):
            changes = (source[i] == 0) - (target[i] == 0)
            if getattr(element, "damper", None) == "bounded":
                stored = [
                    sum(0.5 * model.links[k].stiffness * gaps[k] ** 2 for k in self.acting(model, i, states[i]))
                    for states in (source, target)
                ]
                damped += stored[0] - stored[1] if source[i] and target[i] else 0.0
            elif element.damping and not element.held:
                damped -= changes * 0.5 * element.stiffness * gaps[i] ** 2
            links = [k for k in model.link_indices[i] if model.links[k].held]
            if links and math.isfinite(model.links[links[0]].stiffness):
                sticks = next(
                    k for k, state in enumerate(element.states) if model.link_indices[i].index(links[0]) in state.holds
                )
                if source[i] == sticks != target[i]:
                    dropped += 0.5 * model.links[links[0]].stiffness * gaps[links[0]] ** 2 * element.drop
        return damped, dropped


class TestTransition:
    def test_between_levels(self, case):
        for source, target in case.pairs():
            got = case.core.transition(case.core.level(source), case.core.level(target))
            here, there = case.levels.level(source), case.levels.level(target)
            rest = np.abs(here.asymptotic.configuration) + np.abs(there.asymptotic.configuration)
            terms = got.terms
            assert (terms is None) == (here.excitation.channels == here.excitation.prescribed)
            size = 0.0 if terms is None else np.max(terms[:, :-1], initial=0.0)
            matrix_sizes = np.abs(there.modal.vectors.T) @ (np.abs(here.level.vectors) + 1.0)
            sizes = np.maximum(size, np.max(matrix_sizes, initial=1.0))
            projected, (r, before) = there.modal.vectors.T, (there.modal.modes, here.modal.modes)
            carried = here.channels.carried - there.channels.carried
            near(got.velocity_matrix[:r], np.hstack([projected @ here.modal.vectors, projected @ carried]), sizes)
            near(got.velocity_matrix[r:], np.eye(carried.shape[1], here.width, before))
            set_by = got.matrix[r:] - got.velocity_matrix[r:]  # places that links begin to hold
            moved = np.hstack([here.modal.vectors, here.channels.shapes - there.channels.shapes])
            near(got.matrix[:r], projected @ (moved - there.channels.shapes @ set_by), sizes)
            offset = np.max(np.abs(projected) @ rest, initial=0.0)
            jump = here.asymptotic.configuration - there.asymptotic.configuration
            jump = jump - there.channels.shapes @ got.offset[r:]
            near(got.offset[:r], projected @ jump, offset if terms is None else np.max(terms[:, -1], initial=offset))
            self.check_held(case, here, there, got)
            assert got.start_sizes.size == 0

    def check_held(self, case, here, there, got):
        """Where a link begins to hold, its stretch q in the new level is the one that the state before defines."""
        base, r = case.levels.model.base, there.modal.modes
        for k, link in enumerate(base.held):
            element = next(i for i, links in enumerate(base.link_indices) if link in links)
            row = r + here.excitation.prescribed + k
            if (link in there.modal.indices) and (link not in here.modal.indices):
                stretch, constant = here.stretch(element)
                place, offset = got.matrix[row], got.offset[row]
                held = np.zeros(here.width)
                held[here.modal.modes + here.excitation.prescribed + k] = 1.0
                near(here.level.gap_rows[link] + held - place, stretch, np.max(np.abs(place)))
                near(here.gap_constants[link] - offset, constant, np.abs(offset) + np.abs(constant))
            else:
                assert not np.any(got.offset[row])

    def test_from_the_base(self, case):
        """eta = Psi^T (y - y_inf - R w), eta' = Psi^T (y' - Y w'); channels stay what they are."""
        for key in case.keys:
            got, loaded = case.core.transition(case.core.base, case.core.level(key)), case.levels.level(key)
            vectors, channels, rest = loaded.modal.vectors.T, loaded.channels, loaded.asymptotic.configuration
            (r, m), q = vectors.shape, channels.carried.shape[1]
            sizes = np.abs(vectors) @ np.abs(np.column_stack([channels.shapes, rest]))
            near(got.start_sizes, sizes)
            for matrix, shapes in ((got.matrix, channels.shapes), (got.velocity_matrix, channels.carried)):
                near(matrix[:r], np.hstack([vectors, -(vectors @ shapes)]), np.max(sizes, initial=1.0))
                near(matrix[r:], np.eye(q, m + q, m))
            near(got.offset[:r], -(vectors @ rest), sizes[:, -1])
            assert not np.any(got.offset[r:])


class TestInputs:
    def test_at_any_time(self, case):
        excitation, drive = case.levels.core_excitation(), case.levels.excitation.drive
        inputs, q = core.Inputs(excitation), excitation.prescribed
        end = case.levels.until if q else 1.0
        for time in [0.0, *np.sort(case.random.uniform(0, end, 5)), np.nextafter(end, 0)]:
            interval = excitation.interval_at(time)
            assert excitation.interval_start(interval) <= time < excitation.interval_end(interval)
            until = min(end, excitation.interval_end(interval))
            inputs.set(interval, time - excitation.interval_start(interval), time, until)
            given = drive(time)
            for k, got in enumerate((inputs.values, inputs.rates, inputs.accelerations)):
                near(got, given.values[k], given.sizes[k])
            for k, got in enumerate((inputs.value_sizes, inputs.rate_sizes, inputs.acceleration_sizes)):
                near(got, given.sizes[k])

    def test_moved_on(self, case):
        excitation, drive = case.levels.core_excitation(), case.levels.excitation.drive
        inputs, end = core.Inputs(excitation), case.levels.until if excitation.prescribed else 1.0
        inputs.set(0, 0.0, 0.0, end)
        until = min(end, inputs.interval_end)
        time = 0.0
        for delay in np.full(3, until / 5):
            time += delay
            inputs.advance(delay, time, end)
            assert inputs.age == pytest.approx(time)
            wanted, size = drive(time).values, drive(0.0).sizes + drive(time).sizes
            for k, got in enumerate((inputs.values, inputs.rates, inputs.accelerations)):
                near(got, wanted[k], 10 * np.max(size[k], initial=0.0))


class TestLevels:
    def levels(self, kind="viscous", number=0):
        scene = scene_of(kind, number)
        return LoadedLevels.under(scene.model, Excitation.of(scene.model, (), 1.0), 0.0, 1.0)

    def test_are_built_once(self):
        levels = self.levels()
        key = (0,) * len(levels.model.contacts)
        first = levels.in_core.level(key)
        assert levels.in_core.level(key) is first
        assert levels.model.levels_built == 1
        assert levels.in_core.bytes > first.bytes / 2

    def test_under_other_loads_share_what_does_not_depend_on_them(self):
        levels = self.levels()
        key = (0,) * len(levels.model.contacts)
        levels.in_core.level(key)
        other = LoadedLevels.static(levels.model, np.ones(levels.model.base.modes.count))
        assert_array_equal(other.in_core.level(key).shapes, levels.in_core.level(key).shapes)
        assert levels.model.levels_built == 1

    def test_are_forgotten_but_one(self):
        levels = self.levels()
        made, count = levels.in_core, len(levels.model.contacts)
        kept, other = made.level((0,) * count), made.level((1,) + (0,) * (count - 1))
        made.transition(kept, other)
        before = made.bytes
        del other
        made.forget_but(kept)
        assert made.bytes == kept.bytes < before
        assert made.level((0,) * count) is kept

    def test_a_model_keeps_its_core_model_and_a_copy_makes_its_own(self):
        model = self.levels().model
        assert core_model(model) is core_model(model)
        copy = pickle.loads(pickle.dumps(model))
        assert core_model(copy) is not core_model(model)
        assert core_model(copy).size == core_model(model).size

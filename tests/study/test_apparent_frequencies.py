"""The repetition rate on oscillators whose period is known in closed form, and what a window of a run shows."""

import math

import numpy as np
import pytest
from small_scene import BEAM, write

import multiphi_exudyn as mp
from multiphi_exudyn.study.measures.apparent_frequencies import (
    apparent_frequencies,
    bilinear_frequency,
    natural_frequencies,
    repetition_rate,
)
from multiphi_exudyn.study.running.runners import run_model
from multiphi_exudyn.study.scene.mechanics import mechanics_of
from multiphi_exudyn.study.scene.scenes import load_scene
from multiphi_exudyn.study.scene.workbench import prepare

OPEN = 4.0  # Hz
STIFFER = 20.0  # contact stiffness over the oscillator's own
GAP = 0.1  # m
TIME = 1e-4 * np.arange(30001)
SAMPLED = 1e-7  # of a rate: straight lines between samples 1e-4 s apart
WINDOWS = [(0.0, 0.25), (0.25, 0.5), (0.5, 0.75), (0.75, 1.0), (1.0, 2.0)]


def bilinear(amplitude, ratio=0.0, gap=GAP):
    """x(t) of a unit mass at OPEN released at rest from ``amplitude``, over a compliant stop ``gap`` below."""
    stiffness = (2 * math.pi * OPEN) ** 2
    structure = mp.LinearStructure([[1.0]], [[stiffness]], mp.ModalDamping([ratio]), {"x": 0})
    stop = mp.UnilateralContact("stop", "x", gap, stiffness=STIFFER * stiffness)
    trajectory = mp.simulate(mp.MultiPhiModel(structure, [stop], modes="all"), TIME[-1], displacement=[amplitude])
    assert trajectory.status == "ok"
    return trajectory.at("x", TIME)


def rate(amplitude, gap=GAP):
    """1 / period: arcs of two circles, met at the same displacement and speed."""
    opened = 2 * math.pi * OPEN
    closed = opened * math.sqrt(1 + STIFFER)
    if amplitude <= gap:
        return OPEN
    speed = opened * math.sqrt(amplitude**2 - gap**2)
    below = gap / (1 + STIFFER)  # of the closed level's rest, when the stop is met
    return 1 / (2 * math.acos(-gap / amplitude) / opened + 2 * math.atan2(speed / closed, below) / closed)


class TestRepetitionRate:
    @pytest.mark.parametrize("window", WINDOWS)
    @pytest.mark.parametrize("amplitude", [0.05, 0.11, 0.2, 1.0, 10.0])
    def test_of_a_bilinear_oscillator_is_one_over_its_period(self, amplitude, window):
        assert repetition_rate(TIME, bilinear(amplitude), window) == pytest.approx(rate(amplitude), rel=SAMPLED)

    def test_without_a_gap_is_the_bilinear_frequency_and_large_motion_tends_to_it(self):
        limit = bilinear_frequency(OPEN, OPEN * math.sqrt(1 + STIFFER))
        assert repetition_rate(TIME, bilinear(1.0, gap=0.0), (0.0, 1.0)) == pytest.approx(limit, rel=SAMPLED)
        missing = np.array([limit - repetition_rate(TIME, bilinear(a), (0.0, 1.0)) for a in (1.0, 10.0, 100.0)])
        np.testing.assert_allclose(np.log10(missing[:-1] / missing[1:]), 1.0, atol=0.1)  # as gap / amplitude

    def test_of_a_damped_motion_falls_to_the_open_levels_frequency(self):
        history = bilinear(1.0, ratio=0.05)
        rates = [repetition_rate(TIME, history, (start, start + 0.25)) for start in np.arange(0.0, 2.5, 0.25)]
        assert rates[0] > 1.4 * OPEN
        assert np.all(np.diff(rates[:8]) < 0)
        assert rates[-1] == pytest.approx(OPEN * math.sqrt(1 - 0.05**2), rel=1e-6)

    def test_does_not_count_ripples(self):
        ripple = 0.06 * np.sin(2 * math.pi * 137 * TIME)
        found = repetition_rate(TIME, np.cos(2 * math.pi * OPEN * TIME) + ripple, (0.0, 2.0))
        assert found == pytest.approx(OPEN, rel=5e-3)

    def test_weighs_cycles_by_what_they_fill_of_the_window(self):
        """4 Hz to 1 s, 8 Hz from there: five eighths of the window at the first."""
        phase = np.where(TIME < 1.0, 4 * TIME, 4 + 8 * (TIME - 1.0))
        history = np.sin(2 * math.pi * phase + 1e-3)
        found = repetition_rate(TIME, history, (0.5, 1.3))
        assert found == pytest.approx((0.5 * 4 + 0.3 * 8) / 0.8, rel=2e-2)  # upward cycles alone change at 1 s

    @pytest.mark.parametrize(
        "history", [np.zeros(30001), np.full(30001, 1.0), np.exp(-TIME), np.cos(2 * math.pi * 0.4 * TIME)]
    )
    def test_is_unknown_of_rest_and_of_less_than_a_cycle(self, history):
        assert repetition_rate(TIME, history, (0.0, 0.25)) is None

    def test_is_unknown_where_cycles_fill_less_than_half_the_window(self):
        history = np.where(TIME < 0.6, np.sin(2 * math.pi * 4 * TIME), 0.0)
        assert repetition_rate(TIME, history, (0.0, 0.5)) == pytest.approx(4.0, rel=1e-6)
        assert repetition_rate(TIME, history, (0.0, 2.0)) is None


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    data = BEAM | {"outputs": {"t_end": 0.6, "interval": 1e-4}, "damping": {"modal_ratios": [0.005], "beyond": 0.005}}
    scene = load_scene(write(tmp_path_factory.mktemp("scene") / "scene.toml", data))
    return prepare(scene, mechanics_of(scene))


@pytest.fixture(scope="module")
def run(bench):
    return run_model(bench, "all", progress=False)


class TestWindowsOfARun:
    def test_are_those_that_the_run_reaches(self, bench, run):
        found = apparent_frequencies(bench, run, "tip", (0.1, 0.3, 0.7))
        assert [(each["from"], each["until"]) for each in found] == [(0.0, 0.1), (0.1, 0.3)]

    def test_share_the_time_in_contact_out_among_them(self, bench, run):
        found = apparent_frequencies(bench, run, "tip", (0.1, 0.15, 0.6))
        closed = sum(each["closed"]["stop"] * (each["until"] - each["from"]) for each in found)
        assert closed == pytest.approx(float(np.sum(np.diff(run.contact_intervals["stop"], axis=1))))
        assert closed > 0

    def test_show_the_open_levels_natural_frequencies_and_a_faster_repetition(self, bench, run):
        opened = natural_frequencies(bench, rigid=False)["open"]
        for each in apparent_frequencies(bench, run, "tip", (0.2, 0.3, 0.4)):
            nearest = [min(each["levels"]["open"], key=lambda f, own=own: abs(f - own)) for own in opened[1:3]]
            np.testing.assert_allclose(nearest, opened[1:3], rtol=1e-4)
            assert each["rate"] > 1.05 * opened[0]

    def test_see_nothing_of_what_lies_outside(self, bench, run):
        """A level's longest interval is looked for inside the window only."""
        first = run.contact_intervals["stop"][0, 0]
        (before,) = apparent_frequencies(bench, run, "tip", (0.9 * first,))
        assert set(before["levels"]) == {"open"}
        assert before["closed"] == {"stop": 0.0}


def test_natural_frequencies_are_of_the_contacts_as_given_or_rigid(bench):
    given, rigid = (natural_frequencies(bench, each) for each in (False, True))
    assert list(given) == list(rigid) == ["open", "stop"]
    assert given["open"] == rigid["open"]
    assert np.all(np.array(given["open"][:5]) <= given["stop"][:5])
    assert np.all(np.array(given["stop"][:5]) < rigid["stop"][:5])

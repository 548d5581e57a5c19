"""The error budget: parts that add up exactly, their causes, their uncertainties, and the picture of them."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.container import BarContainer
from small_scene import changed, write

from multiphi_exudyn import MultiPhiValueError
from multiphi_exudyn.study import budget as ladder
from multiphi_exudyn.study.budget import CAUSES, Rung, budget, budget_figure, decomposition
from multiphi_exudyn.study.runs import ModelRun
from multiphi_exudyn.study.scene import load_scene
from multiphi_exudyn.study.setup import prepare

pytestmark = pytest.mark.usefixtures("few_elements")

STEPS, GEOMETRY, CONTACT, TRUNCATION, BODY = CAUSES
FULL = [
    {"kind": "full", "name": "fine", "elements": 4, "step": 1e-4},
    {"kind": "full", "name": "coarse", "elements": 4, "step": 2e-4},
]
TIME = 0.01 * np.arange(101)


def bench_of(folder, **fields):
    data = changed(["damping"], {"modal_ratios": [0.05], "beyond": 0.05}) | {"models": FULL}
    data |= {"comparison": {"reference": "fine", "coarser": "coarse"}}
    data |= {"outputs": {"t_end": 0.05, "interval": 1e-4, "windows": [0.02]}} | fields
    scene = load_scene(write(folder / "scene.toml", data))
    return prepare(scene)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    setup = bench_of(tmp_path_factory.mktemp("scene"))
    return setup, budget(setup, modes=3, progress=False)


def run_of(values, ok=True):
    """A run of two points, of which the second moves half as much."""
    points = {"a": np.asarray(values), "b": 0.5 * np.asarray(values)}
    return ModelRun("m", "full", "m", status="ok" if ok else "failed", message="" if ok else "diverged",
                    time=TIME if ok else TIME[:0], points=points if ok else {})  # fmt: skip


def rungs_of(*answers, uncertainty=1e-3):
    """Rungs of given histories; copies are off by ``uncertainty`` in all samples."""
    names = ("full-working-step", "full-converged", *(f"rung{i}" for i in range(2, len(answers))))
    causes = (*CAUSES[: len(answers) - 1], "")
    return [
        Rung(name, name, cause, run_of(y), {"copy": (run_of(y + uncertainty),)})
        for name, cause, y in zip(names, causes, answers, strict=False)
    ]


def part(parts, cause):
    return next(each for each in parts["parts"] if each["cause"] == cause)


def random_answers(count=6):
    generator = np.random.default_rng(3)
    return [np.sin(7 * TIME) + 0.1 * generator.normal(size=len(TIME)) for _ in range(count)]


@pytest.mark.parametrize("points", [("a",), ("b",), ("a", "b")])
@pytest.mark.parametrize("until", [0.3, 1.0])
def test_shares_add_up_to_one_and_the_total_lies_below_the_sum_of_sizes(points, until):
    answers = random_answers()
    found = decomposition(rungs_of(*answers), points, until)
    inside = until * (1 + 1e-9) >= TIME
    expected = np.linalg.norm((answers[0] - answers[-1])[inside]) / np.linalg.norm(answers[1][inside])
    assert math.fsum(each["share"] for each in found["parts"]) == pytest.approx(1.0, abs=1e-14)
    assert found["total"] == pytest.approx(expected, rel=1e-13)
    assert found["total"] <= math.fsum(each["size"] for each in found["parts"])
    assert [each["cause"] for each in found["parts"]] == list(CAUSES)


def test_orthogonal_parts_have_the_squares_of_their_sizes_as_shares():
    base = np.ones(len(TIME))
    first, second = np.zeros((2, len(TIME)))
    first[10], second[20] = 3.0, 4.0
    found = decomposition(rungs_of(base + first + second, base + second, base), ("a",), 1.0)
    assert [each["share"] for each in found["parts"]] == pytest.approx([9 / 25, 16 / 25], rel=1e-12)
    assert found["total"] == pytest.approx(math.hypot(*(each["size"] for each in found["parts"])), rel=1e-12)


def test_a_part_that_another_undoes_has_a_negative_share():
    base = np.ones(len(TIME))
    found = decomposition(rungs_of(base, 1.2 * base, 0.9 * base), ("a",), 1.0)
    assert [each["share"] for each in found["parts"]] == pytest.approx([-2.0, 3.0])


def test_a_change_of_one_rung_is_seen_in_its_two_parts_only():
    answers = random_answers()
    before = decomposition(rungs_of(*answers), ("a",), 1.0)
    answers[3] = 1.5 * answers[3]
    after = decomposition(rungs_of(*answers), ("a",), 1.0)
    differ = [one["size"] != other["size"] for one, other in zip(before["parts"], after["parts"], strict=True)]
    assert differ == [False, False, True, True, False]
    assert after["total"] == before["total"]


def test_a_part_no_larger_than_its_uncertainty_is_not_significant():
    base = np.ones(len(TIME))
    found = decomposition(rungs_of(1.0015 * base, base, 0.9 * base), ("a",), 1.0)
    assert [each["uncertainty"] for each in found["parts"]] == pytest.approx([2e-3, 2e-3])
    assert [each["significant"] for each in found["parts"]] == [False, True]


def test_a_missing_rung_joins_the_causes_on_both_its_sides():
    rungs = rungs_of(*random_answers())
    rungs[2] = replace(rungs[2], run=run_of(TIME, ok=False))
    found = decomposition(rungs, ("a",), 1.0)
    causes = [each["cause"] for each in found["parts"]]
    assert causes == [STEPS, f"{GEOMETRY} and {CONTACT}", TRUNCATION, BODY]
    assert math.fsum(each["share"] for each in found["parts"]) == pytest.approx(1.0, abs=1e-14)


def test_a_failed_copy_leaves_the_uncertainty_unknown():
    rungs = rungs_of(*random_answers(3))
    rungs[1] = replace(rungs[1], uncertainty_runs={"copy": (run_of(TIME, ok=False),)})
    found = decomposition(rungs, ("a",), 1.0)
    assert [each["uncertainty"] for each in found["parts"]] == [None, None]
    assert [each["significant"] for each in found["parts"]] == [None, None]
    assert found["uncertainty"] is not None


def test_one_rung_or_a_reference_at_rest_has_no_parts():
    assert decomposition(rungs_of(TIME), ("a",), 1.0) is None
    assert decomposition(rungs_of(TIME, 0 * TIME), ("a",), 1.0) is None
    assert (
        decomposition([replace(each, run=run_of(TIME, ok=False)) for each in rungs_of(TIME, TIME)], ("a",), 1.0) is None
    )


def test_every_rung_of_a_small_scene_runs_and_its_values_survive_json(small):
    _, values = small
    assert {rung["message"] for rung in values["rungs"].values()} == {""}
    assert json.loads(json.dumps(values, allow_nan=False)) == values
    assert list(values["windows"]) == ["0.02", "0.05"]
    assert list(values["windows"]["0.05"]["rigid"]) == ["all", "middle", "tip"]
    for ladders in values["windows"].values():
        assert [each["cause"] for each in ladders["rigid"]["all"]["parts"]] == list(CAUSES)
        assert [each["cause"] for each in ladders["compliant"]["all"]["parts"]] == [STEPS, GEOMETRY, TRUNCATION, BODY]


def test_the_answers_below_the_full_beam_hardly_feel_a_disturbance(small):
    parts = small[1]["windows"]["0.05"]["compliant"]["all"]
    assert part(parts, TRUNCATION)["uncertainty"] < 1e-7 < 1e-4 < part(parts, TRUNCATION)["size"]
    assert part(parts, BODY)["size"] < 1e-8


def test_the_full_beams_working_step_is_the_coarser_copys_and_is_halved_at_least_twice(small):
    rungs = small[1]["rungs"]
    assert rungs["full-working-step"]["steps"] == 250
    assert rungs["full-converged"]["steps"] >= 4 * 250
    assert part(small[1]["windows"]["0.05"]["rigid"]["all"], STEPS)["significant"]


def body_with_a_wrong_contact(original):
    """Runners in which the rigid Multi-Phi rung meets its stop elsewhere: a quarter further away."""

    def run(setup, name, progress):
        if name == "multiphi-rigid":
            moved = tuple(replace(each, gap=1.25 * each.gap) for each in setup.mechanics.contacts)
            setup = replace(setup, mechanics=replace(setup.mechanics, contacts=moved))
        return original(setup, name, progress)

    return run


def test_a_rung_made_wrong_shows_in_its_own_parts(small, monkeypatch):
    monkeypatch.setattr(ladder, "run_model", body_with_a_wrong_contact(ladder.run_model))
    wrong = budget(small[0], modes=3, progress=False)["windows"]["0.05"]
    right = small[1]["windows"]["0.05"]
    for cause in (STEPS, GEOMETRY, CONTACT):
        assert part(wrong["rigid"]["all"], cause)["size"] == part(right["rigid"]["all"], cause)["size"]
    assert part(right["rigid"]["all"], BODY)["size"] < 1e-8
    assert part(wrong["rigid"]["all"], BODY)["size"] > 1e-2
    assert wrong["compliant"] == right["compliant"]


def test_a_full_beam_that_fails_is_missing_with_its_cause(tmp_path, monkeypatch):
    original = ladder.run_model

    def run(setup, name, progress):
        failed = ModelRun(name, "full", name, status="failed", message="Newton failed at 0.01 s")
        return failed if setup.scene.models[name].kind == "full" else original(setup, name, progress)

    monkeypatch.setattr(ladder, "run_model", run)
    values = budget(bench_of(tmp_path), modes=3, progress=False)
    assert values["rungs"]["full-converged"]["message"] == "Newton failed at 0.01 s"
    parts = values["windows"]["0.05"]["rigid"]["all"]
    assert parts["reference"] == "linear-compliant"
    assert [each["cause"] for each in parts["parts"]] == [CONTACT, TRUNCATION, BODY]
    drawn = [text.get_text() for axes in budget_figure(values).axes for text in axes.texts]
    assert any("missing" in text and "Newton failed at 0.01 s" in text for text in drawn)


def test_a_scene_without_a_full_beam_starts_at_the_linear_one(tmp_path):
    only = {"models": [{"kind": "reduced", "name": "all", "modes": "all"}], "comparison": {"reference": "all"}}
    setup = bench_of(tmp_path, **only, outputs={"t_end": 0.01, "interval": 1e-3})
    values = budget(setup, modes=3, progress=False)
    assert values["rungs"]["full-converged"]["message"] == "the scene has no full beam"
    assert len(values["windows"]["0.01"]["compliant"]["all"]["parts"]) == 2


def test_levels_with_printed_frequencies_have_no_budget(refused):
    scene = load_scene("paper-rig-as-published", t_end=0.01)
    refused(MultiPhiValueError, "scene", budget, prepare(scene), 3)


def test_the_picture_has_a_bar_for_each_part(small):
    setup, values = small
    with pytest.raises(MultiPhiValueError, match="modes: got 1000"):
        budget(setup, 1000)
    (axes,) = budget_figure(values).axes
    bars = [container for container in axes.containers if isinstance(container, BarContainer)]
    assert [len(group) for group in bars] == [5, 4, 5, 4]
    sizes = [100 * each["size"] for each in values["windows"]["0.05"]["rigid"]["all"]["parts"]]
    assert [bar.get_height() for bar in bars[2]] == pytest.approx(sizes)

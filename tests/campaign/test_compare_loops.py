"""The loop on flat arrays takes the decisions of the NumPy loop: a few random scenes of every kind, in both modes."""

import pytest
from compare_loops import ALL_KINDS, verdict

from multiphi_exudyn.time import loop_motion
from multiphi_exudyn.time.loop import advance

AGREED = {"same", "sensitive"}


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_the_compiled_loop_agrees_with_numpy(kind):
    found = [verdict(kind, number) for number in range(6)]
    assert set(found) <= {*AGREED, "refused"}
    assert found.count("same") >= 3


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_the_loop_as_plain_python_agrees_with_numpy(kind, monkeypatch):
    monkeypatch.setattr(loop_motion, "carry", advance)
    found = [verdict(kind, number) for number in (6, 7)]
    assert set(found) <= {*AGREED, "refused"}
    assert "same" in found


@pytest.mark.parametrize(
    ("kind", "number"),
    [
        ("sampled", 3),  # a load that falls in a millionth of the run: its terms have to be moved on, not made anew
        ("moving stops", 11),  # a level that is packed in the middle of a piece
        ("plain", 30592),  # at rest on a rigid stop when a level begins in which no other mode moves it
        ("plain", 60230),  # two stops let go at nearly one instant, one of which has a twin
    ],
)
def test_scenes_in_which_loops_once_differed(kind, number):
    assert verdict(kind, number) in AGREED

"""The tests of the law run it compiled and as plain Python."""

import pytest

from multiphi_exudyn.time.loop.loop import advance
from multiphi_exudyn.time.run import motion


@pytest.fixture(params=["compiled", "plain"])
def both_ways(request, monkeypatch):
    """Every run of the test in one of the two."""
    if request.param == "plain":
        monkeypatch.setattr(motion, "carry", advance)

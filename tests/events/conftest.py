"""The tests of the law run it compiled and as plain Python."""

import pytest

from multiphi_exudyn.time.run.motion import carry


@pytest.fixture(params=["compiled", "plain"])
def both_ways(request, monkeypatch):
    """Every run of the test in one of the two."""
    if request.param == "plain":
        monkeypatch.setattr(carry, "_native", carry.plain)

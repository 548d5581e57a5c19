"""A growing array is its parts, one after the other, whenever somebody looks."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from multiphi_exudyn.time.record import growing_array
from multiphi_exudyn.time.record.growing_array import GrowingArray


@pytest.mark.parametrize("looks", [(), (3,), (0, 1, 2, 7, 19)])
def test_is_its_parts(looks, monkeypatch):
    monkeypatch.setattr(growing_array, "BLOCK", 10)
    random, parts, found = np.random.default_rng(1), [np.empty((0, 2))], GrowingArray(np.empty((0, 2)))
    for k in range(20):
        parts.append(random.random((int(random.integers(0, 15)), 2)))
        found.add(parts[-1].copy())
        assert found.count == sum(map(len, parts))
        if k in looks:
            assert_array_equal(found.whole, np.concatenate(parts))
    assert_array_equal(found.whole, np.concatenate(parts))
    assert_array_equal(found.whole, np.concatenate(parts))


def test_is_empty_at_first():
    assert GrowingArray(np.empty((0, 3))).whole.shape == (0, 3)


@pytest.mark.parametrize("size", [1, 7, 40])
def test_little_of_it_is_empty(size):
    """A block is full before the next one, which takes an eighth of what there is."""
    found, part = GrowingArray(np.empty((0, 2))), np.ones((size, 2))
    for _ in range(100):
        found.add(part.copy())
        assert part.nbytes // size * found.count <= found.bytes <= 9 / 8 * part.nbytes // size * found.count
    assert found.whole.nbytes == found.bytes == 100 * part.nbytes

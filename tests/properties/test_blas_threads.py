"""A base is built with one BLAS thread, and afterwards there are as many as before."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

import multiphi_exudyn as mp
from multiphi_exudyn.levels.model import level_store
from multiphi_exudyn.mathematics.blas_threads import one_blas_thread


def threads():
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


@pytest.fixture
def two_threads():
    with threadpool_limits(2):
        if threads() != {2}:
            pytest.skip("a BLAS library of one thread")
        yield


@pytest.mark.usefixtures("two_threads")
class TestOneThread:
    def test_of_nested_uses_the_outermost_counts(self):
        with one_blas_thread():
            with one_blas_thread():
                assert threads() == {1}
            assert threads() == {1}
        assert threads() == {2}

    def test_holds_while_a_base_is_built(self, monkeypatch):
        seen, build = [], level_store.build_base
        monkeypatch.setattr(level_store, "build_base", lambda *given: (seen.append(threads()), build(*given))[1])
        stiffness = 4e4 * np.array([[2, -1, 0], [-1, 2, -1], [0, -1, 1]])
        chain = mp.LinearStructure(np.eye(3), stiffness, points={"tip": 2})
        model = mp.MultiPhiModel(chain, [mp.UnilateralContact("stop", "tip", gap=1e-3, stiffness=1e6)])
        assert model.base.complete
        assert seen == [{1}]
        assert threads() == {2}

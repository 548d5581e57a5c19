"""What the whole suite shares: reproducible property tests, and how a bad input has to be refused."""

import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy: on a busy machine threads make small matrices slow

import pytest
from hypothesis import settings

from multiphi_exudyn.errors import MultiPhiError
from multiphi_exudyn.study import plots, runners
from multiphi_exudyn.study import runs as timing
from reference_models.exudyn_quiet import quiet

settings.register_profile("deterministic", derandomize=True, deadline=None)
settings.load_profile("deterministic")


def pytest_configure(config: pytest.Config) -> None:
    """Many tests run badly truncated models on purpose; those of the warnings ask for them."""
    config.addinivalue_line("filterwarnings", "ignore::multiphi_exudyn.errors.MultiPhiWarning")


@pytest.fixture(scope="session", autouse=True)
def short_timing() -> Iterator[None]:
    """Runs are repeated once, and not until their time is steady: nobody looks at it.

    Who does sets ``runners.repeated`` back to ``runs.repeated``.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(timing, "STEADY_S", 0.0)
        patch.setattr(runners, "repeated", lambda run, first, fewest: timing.repeated(run, first, min(fewest, 1)))
        yield


@pytest.fixture(scope="session", autouse=True)
def pictures() -> Iterator[Callable[[], AbstractContextManager[None]]]:
    """Pages hold no pictures, at which nobody looks, but those made ``with pictures():``."""
    draw = plots.png

    @contextmanager
    def drawn() -> Iterator[None]:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(plots, "png", draw)
            yield

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plots, "png", lambda figure: b"")
        yield drawn


@pytest.fixture(scope="session")
def refused() -> Callable[..., None]:
    """``refused(kind, begins, build, ...)``: build(...) raises a MultiPhiError that is also a ``kind``.

    Its message is one line, starts with ``begins`` and says what is needed.
    """

    def check(kind: type[Exception], begins: str, build: Callable[..., Any], *given: Any, **named: Any) -> None:
        with pytest.raises(kind) as caught:
            build(*given, **named)
        message = str(caught.value)
        assert isinstance(caught.value, MultiPhiError)
        assert message.startswith(begins)
        assert "need" in message
        assert "\n" not in message

    return check


@pytest.fixture
def quiet_exudyn() -> Iterator[None]:
    """Exudyn prints nothing in the test; what was set is restored."""
    with quiet():
        yield

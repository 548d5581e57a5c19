"""What tests of scenes share: beams that are quick to compute."""

from collections.abc import Iterator

import pytest

from multiphi_exudyn.study import setup as bench


@pytest.fixture(scope="module")
def few_elements() -> Iterator[None]:
    """Beams of scenes without a full model have 16 elements in place of 57: for modules that ask for no more."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bench, "ELEMENTS", 16)
        yield

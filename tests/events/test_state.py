"""What is positive beyond doubt for all contacts at once is positive for each of them."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from multiphi_exudyn.events.state import Row, Rows


@settings(derandomize=True, max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1e-15, 3e-14, 1e-13, 3e-13, 1e-6, 1.0]), st.booleans())
def test_rows_that_are_clear_are_those_whose_sign_is_positive_but_for_a_narrow_band(seed, left, rated):
    """Sums of which all but a part ``left`` cancels, of either sign."""
    random = np.random.default_rng(seed)
    position, rate = random.normal(size=(2, 30, 8))
    rate *= rated
    x, v, reach = random.normal(size=(3, 8))
    sizes = np.abs(position) @ np.abs(x) + np.abs(rate) @ np.abs(v)
    constant = -(position @ x + rate @ v) + left * random.choice([-1, 1], 30) * sizes
    rows = [Row(*row) for row in zip(position, rate, constant.tolist(), strict=True)]
    clear = Rows.of(rows, 8).clear(x, v, np.abs(reach))
    signs = np.array([row.sign(x, v, np.abs(reach)) for row in rows])
    assert np.all(signs[clear] == 1)
    if left >= 1e-6:
        assert np.array_equal(clear, signs == 1)

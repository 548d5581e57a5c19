"""What a console shows of an object: shares in per cent."""

import math

import pytest

from multiphi_exudyn.display import per_cent


@pytest.mark.parametrize(
    ("share", "told"),
    [
        (0.0, "0 %"),
        (0.00123, "0.12 %"),
        (0.0474, "4.7 %"),
        (0.994, "99 %"),
        (math.nextafter(0.995, 0.0), "99 %"),
        (0.995, "100 %"),
        (0.9999, "100 %"),
        (1.0, "100 %"),
        (12.345, "1234 %"),
    ],
)
def test_a_share_in_per_cent_never_has_an_exponent(share, told):
    assert per_cent(share) == told

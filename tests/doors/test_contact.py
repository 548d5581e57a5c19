"""A contact refuses what is no gap, no stiffness and no name."""

import math

import pytest

from multiphi_exudyn.mechanics.contact import UnilateralContact


def contact(**changes):
    return UnilateralContact(**{"name": "stop", "direction": "tip", "gap": 1e-3} | changes)


class TestUnilateralContact:
    @pytest.mark.parametrize(
        ("kind", "changes", "begins"),
        [
            (ValueError, {"gap": math.nan}, "contact 'stop' gap: got nan"),
            (ValueError, {"gap": math.inf}, "contact 'stop' gap: got inf"),
            (TypeError, {"gap": "wide"}, "contact 'stop' gap: got 'wide'"),
            (TypeError, {"gap": True}, "contact 'stop' gap: got True"),
            (TypeError, {"gap": None}, "contact 'stop' gap: got None"),
            (ValueError, {"stiffness": 0.0}, "contact 'stop' stiffness: got 0.0"),
            (ValueError, {"stiffness": -1e6}, "contact 'stop' stiffness: got -1000000.0"),
            (ValueError, {"stiffness": math.nan}, "contact 'stop' stiffness: got nan"),
            (ValueError, {"restitution": 1.1}, "contact 'stop' restitution: got 1.1, need a value from 0 to 1"),
            (ValueError, {"restitution": -0.5}, "contact 'stop' restitution: got -0.5"),
            (ValueError, {"restitution": 0.5, "stiffness": 1e6}, "contact 'stop' restitution: got 0.5 beside a finite"),
            (TypeError, {"stiffness": 1j}, "contact 'stop' stiffness: got 1j"),
            (ValueError, {"damping": -1.0, "stiffness": 1e6}, "contact 'stop' damping: got -1.0"),
            (ValueError, {"damping": math.inf, "stiffness": 1e6}, "contact 'stop' damping: got inf"),
            (ValueError, {"damping": 1.0}, "contact 'stop' damping: got 1.0 beside an infinite stiffness"),
            (TypeError, {"damping": None}, "contact 'stop' damping: got None"),
            (TypeError, {"name": ""}, "contact name: got ''"),
            (TypeError, {"name": 3}, "contact name: got 3"),
        ],
    )
    def test_refuses(self, refused, kind, changes, begins):
        refused(kind, begins, contact, **changes)

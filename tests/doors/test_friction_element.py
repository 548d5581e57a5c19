"""Friction refuses what is no limit, no spring, no speed and no name; its states say its law."""

import math

import pytest

from multiphi_exudyn.mechanics.friction import Friction


def friction(**changes):
    return Friction(**{"name": "ring", "direction": "tip", "limit": 0.6} | changes)


class TestFriction:
    @pytest.mark.parametrize(
        ("kind", "changes", "begins"),
        [
            (ValueError, {"limit": 0.0}, "friction 'ring' limit: got 0.0, need a finite force > 0"),
            (ValueError, {"limit": -1.0}, "friction 'ring' limit: got -1.0"),
            (ValueError, {"limit": math.inf}, "friction 'ring' limit: got inf"),
            (ValueError, {"limit": math.nan}, "friction 'ring' limit: got nan"),
            (TypeError, {"limit": None}, "friction 'ring' limit: got None"),
            (TypeError, {"limit": True}, "friction 'ring' limit: got True"),
            (ValueError, {"static_limit": 0.5}, "friction 'ring' static_limit: got 0.5, need a finite force >="),
            (ValueError, {"static_limit": math.inf}, "friction 'ring' static_limit: got inf"),
            (ValueError, {"static_limit": math.nan}, "friction 'ring' static_limit: got nan"),
            (TypeError, {"static_limit": "high"}, "friction 'ring' static_limit: got 'high'"),
            (ValueError, {"stiffness": 0.0}, "friction 'ring' stiffness: got 0.0"),
            (ValueError, {"stiffness": -1e6}, "friction 'ring' stiffness: got -1000000.0"),
            (ValueError, {"stiffness": math.nan}, "friction 'ring' stiffness: got nan"),
            (TypeError, {"stiffness": None}, "friction 'ring' stiffness: got None"),
            (ValueError, {"velocity": math.inf}, "friction 'ring' velocity: got inf"),
            (ValueError, {"velocity": math.nan}, "friction 'ring' velocity: got nan"),
            (TypeError, {"velocity": 1j}, "friction 'ring' velocity: got 1j"),
            (TypeError, {"name": ""}, "friction name: got ''"),
            (TypeError, {"name": 3}, "friction name: got 3"),
        ],
    )
    def test_refuses(self, refused, kind, changes, begins):
        refused(kind, begins, friction, **changes)

    def test_has_its_law_as_states(self):
        stick, *slips = friction(static_limit=0.9, stiffness=10.0).states
        assert [state.name for state in (stick, *slips)] == ["stick", "slip+", "slip-"]
        assert [(e.asked, e.force, e.constant) for e in stick.exits] == [("slip+", 1.0, 0.9), ("slip-", -1.0, 0.9)]
        assert [(s.push, s.stretch, s.exits[0].asked, s.exits[0].rate) for s in slips] == [
            (-0.6, 0.06, "stick", 1.0),
            (0.6, -0.06, "stick", -1.0),
        ]

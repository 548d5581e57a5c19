"""A scene that runs in milliseconds, for the tests of scenes, reports and the command line."""

import copy
import json
import math

BEAM = {
    "title": "a small beam over a stop",
    "structure": {
        "beam": {
            "sections": [
                {
                    "start": 0.0,
                    "end": 0.5,
                    "width": 0.02,
                    "height": 0.004,
                    "youngs_modulus": 7e10,
                    "density": 2700,
                }
            ],
            "points": {"middle": 0.3, "tip": 0.5},
            "masses": [{"at": 0.5, "mass": 0.05}],
        }
    },
    "contacts": [{"name": "stop", "direction": "middle", "gap": 1e-3, "stiffness": 1e5}],
    "start": {"load_at": "tip", "measured_at": "tip", "displacement": 0.01},
    "damping": {"modal_ratios": [0.01, 0.02], "beyond": 0.0},
    "outputs": {"t_end": 0.1, "points": ["tip"], "interval": 1e-3},
    "models": [
        {"kind": "reduced", "name": "all", "modes": "all"},
        {"kind": "reduced", "name": "r{modes}"},
    ],
    "comparison": {"reference": "all"},
}


def toml(value):
    """A value as TOML, tables inline."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(key)} = {toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(toml(item) for item in value) + "]"
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else f"{'-' if value < 0 else ''}inf"
    return json.dumps(value)


def write(path, data):
    path.write_text("\n".join(f"{json.dumps(key)} = {toml(value)}" for key, value in data.items()), "utf-8")
    return str(path)


def changed(path, value, data=BEAM):
    """A copy of ``data`` with the entry at ``path`` replaced, or removed where value is None."""
    data = copy.deepcopy(data)
    *outer, last = path
    table = data
    for key in outer:
        table = table[key]
    if value is None:
        del table[last]
    else:
        table[last] = value
    return data

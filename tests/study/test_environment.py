"""Where something ran: what is told of it."""

from multiphi_exudyn.study import runs as environment

LATE = 0.3  # s


def test_an_import_lasts_until_the_public_names_are_there(monkeypatch, tmp_path):
    """They may be loaded when they are asked for: the import of the package alone says nothing."""
    lines = ["import time", "__all__ = ['late']", "def __getattr__(name):", f"    time.sleep({LATE})"]
    (tmp_path / "slow_names.py").write_text("\n".join(lines))
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(environment, "IMPORTED", ("slow_names", "not_there"))
    found = environment.import_times()
    assert found["slow_names"] >= LATE
    assert found["not_there"] is None

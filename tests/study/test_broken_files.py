"""Shipped scene and study files, broken in every way: taken, or refused in one line that names the file.

A file that is refused is exit code 2 of the command line, one line, and nothing written.
"""

import math
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_scene import changed, write

import multiphi_exudyn.study.scene as scenes
import multiphi_exudyn.study.study_file as cases
from multiphi_exudyn import MultiPhiTypeError, MultiPhiValueError, cli
from multiphi_exudyn.study.scene import mechanics_of, read_toml

FOLDERS = {"scene": scenes, "study": cases}
SHIPPED = {
    "scene": sorted(scenes.shipped().values()),
    "study": sorted((Path(cases.__file__).parent / "studies").glob("*.toml")),
}


def places(value, path=()):
    """Paths of all entries of nested tables and arrays."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield [*path, key]
        yield from places(item, (*path, key))


JUNK = st.recursive(
    st.booleans() | st.integers(-(2**60), 2**60) | st.floats() | st.text('ab[]"\n\\{}.é', max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("abc", min_size=1), inner, max_size=3),
    max_leaves=5,
)
HARD = st.sampled_from(
    [math.nan, math.inf, -math.inf, 0, -1, 10**18, -1e300, 5e-324, "", "é\u202e\0", "paper-rig", [], {}, [[]], True]
)
EXISTING = settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])


def load(kind, file):
    if kind == "scene":
        mechanics_of(scenes.load_scene(file))
    else:
        cases.load_study(file)


def check(kind, file, capsys):
    """Taken, or refused in one line; then the command line refuses it alike and leaves nothing behind."""
    try:
        load(kind, str(file))
    except (MultiPhiValueError, MultiPhiTypeError) as error:
        line = str(error)
    else:
        return
    assert line.startswith(str(file))
    assert "\n" not in line
    out = file.parent / "out"
    assert cli.main(["compare" if kind == "scene" else "study", str(file), "--out", str(out)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err == line + "\n"
    assert not out.exists()


@pytest.mark.parametrize("kind", FOLDERS)
class TestBrokenFiles:
    @EXISTING
    @given(data=st.data())
    def test_values_and_keys(self, kind, tmp_path, capsys, data):
        """One or two entries anywhere replaced by junk or removed."""
        content = read_toml(data.draw(st.sampled_from(SHIPPED[kind])))
        for _ in range(data.draw(st.integers(1, 2))):
            place = data.draw(st.sampled_from(list(places(content))))
            content = changed(place, data.draw(st.none() | HARD | JUNK), content)
        file = tmp_path / "broken.toml"
        write(file, content)
        check(kind, file, capsys)

    @EXISTING
    @given(data=st.data())
    def test_text(self, kind, tmp_path, capsys, data):
        """Cut short, a line removed, doubled or moved, bytes put in."""
        text = data.draw(st.sampled_from(SHIPPED[kind])).read_bytes()
        place = data.draw(st.integers(0, len(text)))
        lines = text.splitlines(keepends=True)
        line = data.draw(st.integers(0, len(lines) - 1))
        change = data.draw(st.sampled_from(["cut", "removed", "doubled", "moved", "bytes"]))
        broken = {
            "cut": text[:place],
            "removed": b"".join(lines[:line] + lines[line + 1 :]),
            "doubled": b"".join(lines[: line + 1] + lines[line:]),
            "moved": b"".join([lines[line], *lines[:line], *lines[line + 1 :]]),
            "bytes": text[:place] + data.draw(st.binary(max_size=6)) + text[place:],
        }[change]
        file = tmp_path / "broken.toml"
        file.write_bytes(broken)
        check(kind, file, capsys)

    @EXISTING
    @given(data=st.data())
    def test_names_given_twice(self, kind, tmp_path, capsys, data):
        """An entry of a list of tables stands there twice."""
        content = read_toml(data.draw(st.sampled_from(SHIPPED[kind])))
        lists = [
            key for key, value in content.items() if isinstance(value, list) and value and isinstance(value[0], dict)
        ]
        if lists:
            key = data.draw(st.sampled_from(lists))
            content = changed([key], [*content[key], content[key][-1]], content)
        file = tmp_path / "broken.toml"
        write(file, content)
        check(kind, file, capsys)

    @pytest.mark.parametrize(
        "content", [b"", b"\x00", b"\xff\xfe", b"[[[", b"title", b"a = 1\n" * 10_000, b"\xef\xbb\xbf"]
    )
    def test_no_toml_at_all(self, kind, tmp_path, capsys, content):
        file = tmp_path / "broken.toml"
        file.write_bytes(content)
        with pytest.raises(MultiPhiValueError):
            load(kind, str(file))
        check(kind, file, capsys)

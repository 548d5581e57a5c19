"""The module that is imported is that of these sources, and its stub says what is in it."""

from pathlib import Path

from nanobind.stubgen import StubGen

from multiphi_exudyn import _core

ROOT = Path(__file__).parents[2]
BUILT = Path(_core.__file__)
SOURCES = [
    path for kind in ("*.cpp", "*.hpp", "CMakeLists.txt") for path in ROOT.glob(f"multiphi_exudyn/core/**/{kind}")
]


def test_the_module_is_not_older_than_its_sources():
    newer = [path.name for path in SOURCES if path.stat().st_mtime > BUILT.stat().st_mtime]
    assert newer == [], f"{BUILT} is older; build it again: pip install . (or one line, see CONTRIBUTING.md)"


def test_the_stub_says_what_is_in_the_module():
    now = StubGen(_core)
    now.put(_core)
    written = (ROOT / "multiphi_exudyn" / "_core.pyi").read_text()
    assert written == now.get(), (
        "out of date; write it again: python -m nanobind.stubgen -m multiphi_exudyn._core -o multiphi_exudyn/_core.pyi"
    )

"""The READMEs: their blocks run as printed, their links lead somewhere, and the places they name are there."""

import importlib
import inspect
import pkgutil
import re
import warnings
from pathlib import Path

import pytest

import multiphi_exudyn as mp

ROOT = Path(__file__).parents[2]
READMES = ["README.md", "examples/README.md", "multiphi_exudyn/README.md", "reference_models/README.md"]
BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\]\(([^)\s]+)\)")
HEADER = re.compile(r"`(core/[a-z_/]+\.hpp)`")
PLACE = re.compile(r"`([a-z_]+)(?:\.([A-Za-z_.]+))?`")
LONGEST = 150  # lines of the front page


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def heading_anchors(name: str) -> set[str]:
    """What an anchor to each heading of a README is called."""
    titles = re.findall(r"^#+ (.*)$", text(name), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


@pytest.mark.parametrize("name", ["README.md", "examples/README.md"])
def test_the_blocks_of_a_readme_run_in_order_as_printed(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    blocks = BLOCK.findall(text(name))
    assert blocks
    names: dict[str, object] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mp.MultiPhiWarning)
        for number, block in enumerate(blocks):
            exec(compile(block, f"{name}, block {number}", "exec"), names)
    assert all(tr.status == "ok" for tr in names.values() if isinstance(tr, mp.Trajectory))


@pytest.mark.parametrize("name", [name for name in READMES if name not in ("README.md", "examples/README.md")])
def test_the_other_readmes_have_no_blocks_that_nobody_runs(name):
    assert not BLOCK.findall(text(name))


def test_the_front_page_is_short():
    assert len(text("README.md").splitlines()) <= LONGEST


@pytest.mark.parametrize("name", READMES)
def test_links_and_pictures_lead_somewhere(name):
    for link in LINK.findall(text(name)):
        if link.startswith("http"):
            continue
        path, _, anchor = link.partition("#")
        target = (ROOT / name).parent / path if path else ROOT / name
        assert target.exists(), link
        if anchor:
            assert anchor in heading_anchors(target.relative_to(ROOT).as_posix()), link


def test_every_example_is_in_the_gallery():
    assert [p.name for p in (ROOT / "examples").glob("*.py") if f"]({p.name})" not in text("examples/README.md")] == []


def test_every_picture_is_shown():
    pages = "".join(map(text, READMES))
    assert [p.name for p in (ROOT / "examples").glob("*.[pg][ni][gf]") if f"{p.name})" not in pages] == []


def modules() -> dict[str, list[object]]:
    """Every module of the package by its own name; packages too."""
    found: dict[str, list[object]] = {}
    for info in pkgutil.walk_packages(mp.__path__, "multiphi_exudyn."):
        if not info.name.endswith("__main__"):
            found.setdefault(info.name.rpartition(".")[2], []).append(info.name)
    return found


def test_the_places_of_the_methods_tables_are_there():
    page = text("multiphi_exudyn/README.md")
    rows = [line for line in page.splitlines() if line.startswith("|") and line.count("|") == 4]
    headers = [header for row in rows for header in HEADER.findall(row.split("|")[3])]
    assert len(headers) > 10
    assert [header for header in headers if not (ROOT / "multiphi_exudyn" / header).exists()] == []
    places = [place for row in rows for place in PLACE.findall(row.split("|")[3])]
    assert len(places) > 15
    known = modules()
    for module, path in places:
        assert module in known, module
        assert not path or any(_has(name, path) for name in known[module]), f"{module}.{path}"


def _has(name: str, path: str) -> bool:
    thing: object = importlib.import_module(name)
    for part in path.split("."):
        if not hasattr(thing, part):
            return False
        thing = inspect.getattr_static(thing, part)
    return True

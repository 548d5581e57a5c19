"""An installed package has all that a clone has: every file of its folders that is no Python is named in pyproject."""

from __future__ import annotations

import sys
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[2]


def test_every_template_and_shipped_file_is_installed():
    named = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]
    installed = {
        path
        for package, patterns in named.items()
        for pattern in patterns
        for path in ROOT.joinpath(*package.split(".")).glob(pattern)
    }
    kinds = {".toml", ".j2", ".js", ".css", ".md", ".typed"}
    files = {p for folder in ("multiphi_exudyn", "reference_models") for p in (ROOT / folder).rglob("*.*")}
    assert {str(p.relative_to(ROOT)) for p in files - installed if p.suffix in kinds} == set()

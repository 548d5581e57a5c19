"""An installed package has all that a clone has but the core's sources, of which it has the module."""

import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACK = "import sys; from scikit_build_core.build import build_wheel; build_wheel(sys.argv[1], {'wheel.cmake': 'false'})"


def test_every_file_but_the_core_s_sources_is_installed(tmp_path):
    subprocess.run([sys.executable, "-c", PACK, str(tmp_path)], cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.iterdir()
    packed = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    files = {
        path.relative_to(ROOT).as_posix()
        for folder in ("multiphi_exudyn", "reference_models")
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and path.parent.name != "__pycache__" and path.suffix not in (".so", ".pyd")
    }
    assert packed == {name for name in files if not name.startswith("multiphi_exudyn/core/")}
    assert {"multiphi_exudyn/py.typed", "multiphi_exudyn/_core.pyi", "reference_models/README.md"} <= packed

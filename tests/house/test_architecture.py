"""The house: imports go down the floors only, heavy packages stay on theirs, one import pulls in neither of them."""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FLOORS = (
    ("errors",),
    ("mathematics",),
    ("mechanics",),
    ("levels",),
    ("events",),
    ("time",),
    ("steady",),
    ("exudyn_plugin",),
    ("study.scene",),
    ("study.running",),
    ("study.measures", "study.sweep"),
    ("study.comparison",),
    ("study.accuracy", "study.stability"),
    ("cli",),
)
HEAVY = {
    "exudyn": ("multiphi_exudyn/exudyn_plugin", "reference_models"),
    "matplotlib": ("multiphi_exudyn/study",),
    "numba": ("multiphi_exudyn/time/compiled",),
    "distributed": ("multiphi_exudyn/study/sweep",),
}


def sources() -> list[Path]:
    return sorted([*ROOT.glob("multiphi_exudyn/**/*.py"), *ROOT.glob("reference_models/*.py")])


def imported(node: ast.AST) -> Iterator[str]:
    """Full names of the modules that a statement imports."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        assert node.level == 0, "relative imports hide the floor"
        yield str(node.module)
        yield from (f"{node.module}.{alias.name}" for alias in node.names)


def floor(module: str) -> int | None:
    """The floor of one of our modules, None for everybody else's; reference models stand beside the study."""
    parts = module.split(".")
    if parts[0] == "reference_models":
        return floor("multiphi_exudyn.exudyn_plugin")
    if parts[0] != "multiphi_exudyn" or len(parts) == 1:
        return None
    room = ".".join(parts[1 : 3 if parts[1] == "study" else 2])
    return next((level for level, rooms in enumerate(FLOORS) if room in rooms), None)


def module_name(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


@pytest.mark.parametrize("path", sources(), ids=module_name)
def test_imports_go_down_only(path):
    here = floor(module_name(path))
    if here is None:
        assert path.name == "__init__.py", f"{path.name} stands on no floor"
        return
    for node in ast.walk(ast.parse(path.read_text())):
        for name in imported(node):
            there = floor(name)
            assert there is None or there <= here, f"{path.name} on floor {here} imports {name} of floor {there}"


@pytest.mark.parametrize("package", HEAVY)
def test_a_heavy_package_is_imported_on_its_own_floor_only(package):
    for path in sources():
        names = {name.split(".")[0] for node in ast.walk(ast.parse(path.read_text())) for name in imported(node)}
        inside = path.relative_to(ROOT).as_posix().startswith(HEAVY[package])
        assert package not in names or inside, f"{path} imports {package}"


@pytest.mark.parametrize("path", sources(), ids=module_name)
def test_nothing_light_is_imported_inside_a_function(path):
    for function in ast.walk(ast.parse(path.read_text())):
        if isinstance(function, (ast.FunctionDef, ast.AsyncFunctionDef)):
            names = {name.split(".")[0] for node in ast.walk(function) for name in imported(node)}
            names -= {"multiphi_exudyn"} if path.name == "simulate.py" else set()  # the compiled loop, with numba
            assert names <= set(HEAVY), f"{path.name}: {function.name} imports {names}"


def test_the_floors_see_a_breach():
    assert floor("multiphi_exudyn.study.comparison.report") > floor("multiphi_exudyn.levels.model")
    assert next(imported(ast.parse("from multiphi_exudyn.study.comparison import report").body[0])) == (
        "multiphi_exudyn.study.comparison"
    )


def test_importing_the_package_loads_neither_exudyn_nor_matplotlib():
    code = "import sys, multiphi_exudyn; print(sorted({'exudyn', 'matplotlib', 'pydantic', 'tqdm'} & set(sys.modules)))"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert found.stdout.strip() == "[]"

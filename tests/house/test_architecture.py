"""The house: imports go to earlier rooms and files only, heavy packages stay in theirs, one import pulls in neither.

Every package says in its docstring, after "Order:", in which order its files and rooms stand; each may import only
those before it, and a package itself stands after what is in it. This is one order of all modules, so nothing imports
in a circle. Imports for type checkers, inside functions and by a string count like any other.
"""

import ast
import functools
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
from posix_modules import POSIX

ROOT = Path(__file__).parents[2]
BESIDE = ("reference_models", "exudyn_plugin")  # a package beside the house, and the room after which it stands
HEAVY = {
    "exudyn": ("multiphi_exudyn/exudyn_plugin", "reference_models"),
    "matplotlib": (
        "multiphi_exudyn/study",
        "multiphi_exudyn/levels/level/mode_figure.py",
        "multiphi_exudyn/levels/level/level.py",
        "multiphi_exudyn/time/histories.py",
    ),
    "pandas": ("multiphi_exudyn/time/many.py", "multiphi_exudyn/study", "multiphi_exudyn/time/histories.py"),
    "distributed": ("multiphi_exudyn/study/sweep.py",),
    "tqdm": (*(f"multiphi_exudyn/{room}" for room in ("mathematics", "time", "study", "cli")), "reference_models"),
    "h5py": ("multiphi_exudyn/mechanics/files.py",),
    "meshio": ("multiphi_exudyn/time/mesh_output.py",),
    "pyyeti": ("multiphi_exudyn/mechanics/files.py",),
}
CORE = "multiphi_exudyn._core"
LATE = (  # load what they name when it is asked for: a command's own module, the public names
    "multiphi_exudyn.cli",
    "multiphi_exudyn",
)


def sources() -> list[Path]:
    """Every Python file of the house; ``core`` is C++, and what pip calls to compile it."""
    ours = [*ROOT.glob("multiphi_exudyn/**/*.py"), *ROOT.glob("reference_models/*.py")]
    return sorted(path for path in ours if path.parts[len(ROOT.parts) + 1] != "core")


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


NAMES = {module_name(path): path for path in sources()}
PACKAGES = sorted(name for name, path in NAMES.items() if path.name == "__init__.py")


@functools.cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text())


def importing(root: ast.AST) -> Iterator[ast.AST]:
    """Nodes that may import something."""
    return (node for node in ast.walk(root) if isinstance(node, (ast.Import, ast.ImportFrom, ast.Call)))


@functools.cache
def order(package: str) -> tuple[str, ...]:
    """What stands in a package, from the first that may be imported by all others."""
    said = re.search(r"^Order: ([^.]*)\.", ast.get_docstring(tree(NAMES[package])) or "", re.MULTILINE)
    assert said, f"{package}: no order of its files in its docstring"
    return tuple(re.split(r",\s+", said[1]))


def called(node: ast.Call) -> str | None:
    """The name of what is called, without that of the module or object it is of."""
    return getattr(node.func, "attr", None) or getattr(node.func, "id", None)


def imported(node: ast.AST) -> Iterator[str]:
    """Full names of what a node imports, by a statement or by a string; of ``from a import b`` both a and a.b."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names)
    elif isinstance(node, ast.ImportFrom):
        assert node.level == 0, "relative imports hide the room"
        yield from (f"{node.module}.{alias.name}" for alias in node.names)
    elif isinstance(node, ast.Call) and called(node) in ("import_module", "__import__"):
        assert isinstance(node.args[0], ast.Constant), "imports by a name that is computed hide the room"
        yield str(node.args[0].value)


@functools.cache
def imports_of(path: Path) -> frozenset[str]:
    """Full names of all that a file imports but for the core, which stands before all rooms and imports nothing."""
    names = frozenset(name for node in importing(tree(path)) for name in imported(node))
    return frozenset(name for name in names if not name.startswith(CORE))


def module_of(name: str) -> str | None:
    """The module of ours that a full name stands for or in, None for everybody else's."""
    while name and name not in NAMES:
        name = name.rpartition(".")[0]
    return name or None


def rank(module: str) -> tuple[float, ...]:
    """Where a module stands: smaller is earlier; a package stands after all that is in it."""
    parts = module.split(".")
    place = [order("multiphi_exudyn").index(BESIDE[1]) + 0.5] if parts[0] == BESIDE[0] else []
    place += [order(".".join(parts[:depth])).index(parts[depth]) for depth in range(1, len(parts))]
    return (*place, float("inf"))


def breaches(importer: str, names: Iterable[str]) -> list[str]:
    """What a module must not import of what it does import."""
    modules = {module_of(name) for name in names} - {None}
    return [name for name in sorted(modules) if rank(name) >= rank(importer)]


def breaches_of(importer: str, code: str) -> list[str]:
    """What a module must not import of what it does import in this code."""
    return breaches(importer, [name for node in ast.walk(ast.parse(code)) for name in imported(node)])


@pytest.mark.parametrize("package", PACKAGES)
def test_a_package_names_all_that_is_in_it(package):
    inside = {name.rpartition(".")[2] for name in NAMES if name.rpartition(".")[0] == package}
    assert sorted(order(package)) == sorted(inside)


def test_no_code_stands_beside_the_rooms():
    assert [path.name for path in ROOT.glob("*.py")] == []


def test_imports_go_to_earlier_rooms_and_files_only():
    assert {name: found for name, path in NAMES.items() if (found := breaches(name, imports_of(path)))} == {}


BREACHES = {
    "a later room": ("levels.level.level", "from multiphi_exudyn.time.simulate import simulate"),
    "a later file": ("levels.level.level", "from multiphi_exudyn.levels.model.model import MultiPhiModel"),
    "a later file by its room": ("levels.level.level", "from multiphi_exudyn.levels.model import model"),
    "itself": ("levels.level.level", "from multiphi_exudyn.levels.level.level import Level"),
    "its own room": ("levels.level.level", "import multiphi_exudyn.levels"),
    "the whole house": ("levels.level.level", "import multiphi_exudyn as mp"),
    "a later room within one": ("study.scene_tables", "from multiphi_exudyn.study import runs"),
    "what stands beside": ("time.simulate", "import reference_models.rig"),
    "for a type checker": ("levels.level.level", "if TYPE_CHECKING:\n    from multiphi_exudyn.levels import model"),
    "inside a function": ("levels.level.level", "def f():\n    from multiphi_exudyn.time import excitation"),
    "by a string": ("levels.level.level", "importlib.import_module('multiphi_exudyn.time.excitation').after"),
    "by a string alone": ("levels.level.level", "f = import_module('multiphi_exudyn.time.excitation')"),
    "by the built-in": ("levels.level.level", "__import__('multiphi_exudyn.time.excitation')"),
}


@pytest.mark.parametrize("case", BREACHES)
def test_a_breach_of_the_order_is_seen(case):
    importer, code = BREACHES[case]
    assert len(breaches_of(f"multiphi_exudyn.{importer}", code)) == 1


@pytest.mark.parametrize("code", ["from . import level", "import_module(name)", "__import__(f'{package}.rule')"])
def test_an_import_that_hides_what_it_imports_is_refused(code):
    with pytest.raises(AssertionError, match="hide"):
        breaches_of("multiphi_exudyn.levels.model.model", code)


LET_PASS = {
    "an earlier file": ("multiphi_exudyn.levels.model.model", "from multiphi_exudyn.levels.level.level import Level"),
    "an earlier room": ("multiphi_exudyn.levels.model.model", "import multiphi_exudyn.mathematics.modes"),
    "what is in it": ("multiphi_exudyn", "from multiphi_exudyn.time.simulate import simulate"),
    "the plugin": ("reference_models.rig", "from multiphi_exudyn.exudyn_plugin import reduce"),
    "a reference": ("multiphi_exudyn.study.runs", "from reference_models.rig import rig_beam"),
    "a string that is no import": ("multiphi_exudyn.errors", "monkeypatch.setattr('multiphi_exudyn.cli.main', 0)"),
}


@pytest.mark.parametrize("case", LET_PASS)
def test_what_is_no_breach_is_let_pass(case):
    importer, code = LET_PASS[case]
    assert breaches_of(importer, code) == []


@pytest.mark.parametrize("package", HEAVY)
def test_a_heavy_package_is_imported_in_its_own_room_only(package):
    for path in sources():
        names = {name.split(".")[0] for name in imports_of(path)}
        inside = path.relative_to(ROOT).as_posix().startswith(HEAVY[package])
        assert package not in names or inside, f"{path} imports {package}"


def test_what_only_posix_has_is_imported_nowhere():
    for path in sources():
        assert not {name.split(".")[0] for name in imports_of(path)} & set(POSIX), path


def test_nothing_light_is_imported_inside_a_function():
    for module in NAMES.keys() - set(LATE):
        for function in ast.walk(tree(NAMES[module])):
            if isinstance(function, (ast.FunctionDef, ast.AsyncFunctionDef)):
                names = {name for node in importing(function) for name in imported(node)}
                light = {name for name in names if name.split(".")[0] not in HEAVY}
                assert not light, f"{module}: {function.name} imports {light}"


HEAVY_FOR_A_USER = {"exudyn", "matplotlib", "pandas", "pydantic", "tqdm"}


def test_importing_the_package_loads_nothing_heavy():
    """Nor does the first public name that is asked for, nor do all of them."""
    steps = [
        ("import multiphi_exudyn as mp", HEAVY_FOR_A_USER | {"numpy", "scipy"}),
        ("mp.simulate", HEAVY_FOR_A_USER),
        ("from multiphi_exudyn import *; simulate", HEAVY_FOR_A_USER),
    ]
    code = "\n".join(f"{step}\nprint(sorted({heavy} & set(sys.modules)))" for step, heavy in steps)
    found = subprocess.run(
        [sys.executable, "-c", f"import sys\n{code}"], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert found.stdout.split("\n") == ["[]", "[]", "[]", ""]


def test_the_package_shows_its_public_names_and_its_rooms_and_no_others():
    import multiphi_exudyn as mp
    from multiphi_exudyn import public

    assert set(public.__all__) <= set(dir(mp))
    assert mp.__all__ == public.__all__
    assert all(getattr(mp, name) is getattr(public, name) for name in public.__all__)
    assert mp.mechanics.beam.planar_beam is mp.planar_beam
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        _ = mp.simulat

"""What pip calls to build the package: scikit-build-core, and a compiler from the package index where there is none.

The core is C++20. Where neither CXX nor any usual compiler makes a C++20 library, the wheel ``ziglang`` becomes a
requirement of the build: it holds clang with its own C++ library. pyproject.toml names this file.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

import scikit_build_core.build as scikit_build
from scikit_build_core.build import (
    build_sdist,
    get_requires_for_build_sdist,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]

Settings = dict[str, "list[str] | str"] | None

BUILD = Path("build")  # beside pyproject.toml, where pip calls; git ignores it
KEPT = BUILD / "zig"  # a copy of the wheel at a place that stays: it compiles its C++ library for the place where it is
TRIAL = "#include <concepts>\n#include <string>\nstd::string f(std::integral auto x) { return std::to_string(x); }\n"
COMPILERS = ("c++", "g++", "clang++")
TOOLS = {"c++": "c++ -mcpu=baseline", "ar": "ar", "ranlib": "ranlib"}  # baseline: code for any processor of the kind
SCRIPT = """#!/bin/sh
exec env ZIG_GLOBAL_CACHE_DIR='{kept}/cache' ZIG_LOCAL_CACHE_DIR='{kept}/cache' '{kept}/ziglang/zig' {tool} "$@"
"""


def compiles(compiler: str) -> bool:
    """Whether it makes a library of C++20."""
    with tempfile.TemporaryDirectory() as folder:
        source, library = Path(folder, "trial.cpp"), Path(folder, "trial.so")
        source.write_text(TRIAL)
        command = [compiler, "-std=c++20", "-shared", "-fPIC", str(source), "-o", str(library)]
        return subprocess.run(command, capture_output=True, check=False).returncode == 0


def system_compiler() -> str | None:
    """The first usual compiler that works."""
    if sys.platform == "darwin" and subprocess.run(["xcode-select", "-p"], capture_output=True, check=False).returncode:
        return None  # /usr/bin/c++ is there, but only asks to install the tools
    return next((name for name in COMPILERS if shutil.which(name) and compiles(name)), None)


def needs_search() -> bool:
    """Whether nobody has named a compiler; on Windows CMake looks for Visual Studio."""
    return sys.platform != "win32" and not os.environ.get("CXX")


def zig_requirement() -> list[str]:
    """The wheel, where no compiler is found and no copy of it is kept from an earlier call."""
    return ["ziglang"] if needs_search() and system_compiler() is None and not (KEPT / "ziglang").is_dir() else []


def keep_zig() -> None:
    """A copy of the wheel, and a compiler and its tools beside each other, where CMake looks for them."""
    if not (KEPT / "ziglang").is_dir():
        found = importlib.util.find_spec("ziglang")
        if found is None or found.origin is None:
            raise SystemExit(
                "multiphi_exudyn: no compiler makes C++20 here, and the package ziglang is not installed; what is "
                "needed: a C++ compiler (g++ 10, clang 13 or newer), or ziglang beside the other build requirements"
            )
        shutil.rmtree(KEPT, ignore_errors=True)
        shutil.copytree(Path(found.origin).parent, KEPT / "copying")
        (KEPT / "copying").rename(KEPT / "ziglang")
    for name, tool in TOOLS.items():
        script = KEPT / name
        script.write_text(SCRIPT.format(kept=KEPT.resolve(), tool=tool))
        script.chmod(0o755)


def prepare() -> None:
    """A compiler and Python's headers, or one clear error; and a build folder that only holds what lasts."""
    headers = Path(sysconfig.get_path("include"))
    if not (headers / "Python.h").is_file():
        raise SystemExit(
            f"multiphi_exudyn: {headers}/Python.h is missing; what is needed: Python with its headers "
            "(Debian, Ubuntu: the package python3-dev; Fedora: python3-devel)"
        )
    if needs_search():
        compiler = system_compiler()
        if compiler is None:
            keep_zig()
            compiler = str((KEPT / "c++").resolve())
        os.environ["CXX"] = compiler
    # What CMake remembers of the last call's temporary environment goes, and scikit-build-core's note of it, which
    # would have it remove all that is compiled.
    for note in BUILD.glob("*/.skbuild-info.json"):
        for remembered in (note, note.with_name("CMakeCache.txt")):
            remembered.unlink(missing_ok=True)
        for folder in note.parent.glob("CMakeFiles/[0-9]*"):
            shutil.rmtree(folder)


def get_requires_for_build_wheel(config_settings: Settings = None) -> list[str]:
    """What a wheel needs beside pyproject's requirements: CMake, ninja and a compiler, where they are missing."""
    return [*scikit_build.get_requires_for_build_wheel(config_settings), *zig_requirement()]


def get_requires_for_build_editable(config_settings: Settings = None) -> list[str]:
    """The same for an editable install."""
    return [*scikit_build.get_requires_for_build_editable(config_settings), *zig_requirement()]


def build_wheel(wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None) -> str:
    """Compile what has changed, and pack."""
    prepare()
    return scikit_build.build_wheel(wheel_directory, config_settings, metadata_directory)


def build_editable(
    wheel_directory: str, config_settings: Settings = None, metadata_directory: str | None = None
) -> str:
    """Compile what has changed; the package stays where it is, the module beside it."""
    prepare()
    return scikit_build.build_editable(wheel_directory, config_settings, metadata_directory)

"""Docstrings of everything public: their sections, every parameter by its name, and examples that run as printed."""

import dataclasses
import doctest
import functools
import inspect
import re
import warnings
from types import FunctionType

import pytest

import multiphi_exudyn as mp
from multiphi_exudyn import exudyn_plugin

RESULTS = {  # handed out, never made by a user: what they hold stands under Attributes
    "Assembly",
    "BodyHistories",
    "CondensedStructure",
    "Equilibrium",
    "Event",
    "FrequencyResponse",
    "Item",
    "Ledger",
    "Level",
    "LinearizedStructure",
    "ManyRuns",
    "ModalStructure",
    "RangeCheck",
    "Reduction",
    "SavedTrajectory",
    "SteadyState",
    "Trajectory",
}
MEMBERS = FunctionType, classmethod, property, functools.cached_property
HEADING = re.compile(r"^(\w+)\n-+\n", re.MULTILINE)
ENTRY = re.compile(r"^(\w[\w, ]*?)(?: : [^:\n]+)?$", re.MULTILINE)  # name, name : type
POINTER = re.compile(r"the module's docstring|\b\w+\.py\b")  # which help() cannot follow


def public() -> dict[str, object]:
    """Everything public that has a docstring of its own, by its full name."""
    rooms = ("multiphi_exudyn", mp), ("multiphi_exudyn.exudyn_plugin", exudyn_plugin)
    return {
        f"{place}.{name}": getattr(room, name)
        for place, room in rooms
        for name in room.__all__
        if callable(getattr(room, name))
    }


PUBLIC = public()


def sections(thing: object) -> dict[str, str]:
    """The text of a docstring by its headings; what stands before the first one by "summary"."""
    parts = HEADING.split(inspect.getdoc(thing) or "")
    return {"summary": parts[0]} | dict(zip(parts[1::2], parts[2::2], strict=True))


def named(text: str) -> list[str]:
    """The names that a section of parameters, attributes or errors describes."""
    return [name for line in ENTRY.findall(text) for name in line.split(", ")]


def parameters(thing: object) -> list[str]:
    """The names that a call takes, private ones left out."""
    return [name for name in inspect.signature(thing).parameters if not name.startswith("_")]


def is_error(thing: object) -> bool:
    return isinstance(thing, type) and issubclass(thing, (Exception, Warning))


def bases(thing: type) -> list[type]:
    """A class and what it inherits from in this package."""
    return [base for base in thing.__mro__ if base.__module__.startswith("multiphi_exudyn")]


def members(thing: type) -> dict[str, object]:
    """Public methods and properties that this package defines, by their names."""
    found = {
        name: inspect.getattr_static(base, name)
        for base in reversed(bases(thing))
        for name in vars(base)
        if not name.startswith("_")
    }
    return {name: member for name, member in found.items() if isinstance(member, MEMBERS)}


def examples(name: str) -> list[doctest.DocTest]:
    """The examples of a public thing, of its methods, and of those that it inherits."""
    thing, finder = PUBLIC[name], doctest.DocTestFinder()
    found = finder.find(thing, name, globs={})
    for base in bases(thing)[1:] if isinstance(thing, type) else ():
        found += finder.find(base, globs={})
    return [test for test in found if test.examples]


@pytest.mark.parametrize("name", PUBLIC)
def test_a_docstring_is_complete(name):
    """One sentence first, the sections of its kind, every parameter or field, and errors of this package alone."""
    thing, found, text = PUBLIC[name], sections(PUBLIC[name]), inspect.getdoc(PUBLIC[name]) or ""
    summary, of_results = text.partition("\n\n")[0], name.rpartition(".")[2] in RESULTS
    assert "\n" not in summary
    assert summary.endswith(".")
    assert not POINTER.search(text)
    assert needed_sections(thing, of_results) <= set(found)
    assert all(content.strip() for content in found.values())
    assert all(is_error(getattr(mp, error, None)) for error in named(found.get("Raises", "")))
    if of_results:
        listed = dataclasses.fields(thing) if dataclasses.is_dataclass(thing) else ()
        fields = {field.name for field in listed if not field.name.startswith("_")}
        assert fields <= set(named(found["Attributes"]))
    elif not is_error(thing):
        assert named(found["Parameters"]) == parameters(thing)


def needed_sections(thing: object, of_results: bool) -> set[str]:
    """The headings of a docstring: of an error, of what is handed out, of a class, of a function."""
    if is_error(thing):
        return {"Examples"}
    if of_results:
        return {"Attributes"}
    return {"Parameters", "Raises", "Examples"} | (set() if isinstance(thing, type) else {"Returns"})


@pytest.mark.parametrize("name", [name for name in PUBLIC if isinstance(PUBLIC[name], type)])
def test_public_methods_say_what_they_give_and_all_their_parameters(name):
    texts = {member: inspect.getdoc(given) or "" for member, given in members(PUBLIC[name]).items()}
    assert [member for member, text in texts.items() if not text.partition("\n")[0].strip()] == []
    assert [member for member, text in texts.items() if POINTER.search(text)] == []
    for member in members(PUBLIC[name]):
        method = getattr(PUBLIC[name], member)
        if "Parameters" in sections(method):
            assert ["self", *named(sections(method)["Parameters"])][-len(parameters(method)) :] == parameters(method)


@pytest.mark.parametrize("name", PUBLIC)
def test_its_examples_run_as_printed(name, tmp_path, monkeypatch):
    """Results may have none: the function that hands them out has one."""
    monkeypatch.chdir(tmp_path)
    found = examples(name)
    assert name in [test.name for test in found] or name.rpartition(".")[2] in RESULTS
    runner = doctest.DocTestRunner()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", mp.MultiPhiWarning)
        failed = [test.name for test in found if runner.run(test).failed]
    assert failed == []

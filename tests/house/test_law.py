"""The law is found once: its sentences stand in one header, in order, and equations where they are said to stand."""

import functools
import importlib
import inspect
import pkgutil
import re
from pathlib import Path
from types import ModuleType

import multiphi_exudyn
from multiphi_exudyn import levels

CORE = Path(multiphi_exudyn.__file__).parent / "core"
NAME = re.compile(r"\b([a-z_]+)\.([A-Za-z_.]*[A-Za-z_])\b")
ROW = re.compile(r"^    (\(38\.\d\)) (.*)$", re.MULTILINE)
RULE = re.compile(r"^    // -+\n", re.MULTILINE)  # above one sentence or two, and the functions that implement them
SENTENCE = re.compile(r"^    // (\d+)\. ", re.MULTILINE)
SENTENCES = [str(number) for number in range(1, 13)]


def doc(thing: object) -> str:
    return inspect.getdoc(thing) or ""


def places(text: str) -> set[str]:
    return {".".join(found) for found in NAME.findall(text)}


def table(room: object) -> dict[str, set[str]]:
    """The places of a room's table, by equation."""
    found: dict[str, set[str]] = {}
    for number, text in ROW.findall(doc(room)):
        found[number] = found.get(number, set()) | places(text)
    return found


@functools.cache
def modules(room: ModuleType) -> dict[str, ModuleType]:
    """The files of a room and of the rooms in it, by their own names, of which there is one each."""
    names = [info.name for info in pkgutil.walk_packages(room.__path__, f"{room.__name__}.") if not info.ispkg]
    found = {name.rpartition(".")[2]: importlib.import_module(name) for name in names}
    assert len(found) == len(names)
    return found


def sections() -> list[str]:
    """The sentences of the law, each with the declarations of the functions that implement it."""
    return RULE.split((CORE / "law/law.hpp").read_text(encoding="utf-8"))[1:]


def test_the_law_has_its_sentences_in_order():
    assert [number for section in sections() for number in SENTENCE.findall(section)] == SENTENCES


def test_each_sentence_stands_above_functions():
    functions = re.compile(r"^    \w.*\(", re.MULTILINE)
    assert [section for section in sections() if not functions.search(section)] == []


def test_equations_stand_where_they_are_said_to():
    assert len(table(levels)) == 5
    for found in table(levels).values():
        assert found
        for place in found:
            module, *names = place.split(".")
            if names == ["hpp"]:
                assert (CORE / f"{module}.hpp").is_file()
            else:
                functools.reduce(getattr, names, modules(levels)[module])

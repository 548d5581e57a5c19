"""The law is found once: where its sentences and equations are said to stand, there they stand, and nowhere else."""

import functools
import importlib
import inspect
import pkgutil
import re
from types import ModuleType

import pytest

from multiphi_exudyn import events, levels
from multiphi_exudyn.events import law

NAME = re.compile(r"\b([a-z_]+)\.([A-Za-z_.]*[A-Za-z_])\b")
ROW = re.compile(r"^    (\(38\.\d\)) (.*)$", re.MULTILINE)
SENTENCE = re.compile(r"^(\d+)\. .*?^   -> (.*?)(?=^\S)", re.MULTILINE | re.DOTALL)
NUMBERS = re.compile(r"(\d+(?:, \d+)*)\. ")
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


@functools.cache
def numbered() -> dict[str, set[str]]:
    """The functions of the room of events whose docstrings begin with the number of a sentence."""
    found: dict[str, set[str]] = {number: set() for number in SENTENCES}
    for module, code in modules(events).items():
        for name, function in inspect.getmembers(code, inspect.isfunction):
            said = NUMBERS.match(doc(function))
            for number in said[1].split(", ") if said and function.__module__ == code.__name__ else ():
                found[number].add(f"{module}.{name}")
    return found


def test_the_law_has_its_sentences_in_order():
    assert [number for number, _ in SENTENCE.findall(doc(law))] == SENTENCES


@pytest.mark.parametrize("number", SENTENCES)
def test_a_sentence_names_the_functions_that_say_so_themselves(number):
    sentences = {found: places(text) for found, text in SENTENCE.findall(doc(law))}
    assert sentences[number] == numbered()[number] != set()


@pytest.mark.parametrize("room", [events, levels], ids=["events", "levels"])
def test_equations_stand_where_they_are_said_to(room):
    assert table(room)
    for found in table(room).values():
        assert found
        for place in found:
            module, *names = place.split(".")
            functools.reduce(getattr, names, modules(room)[module])

"""Models are compiled beside the search, which asks for the same ones."""

from __future__ import annotations

from threading import Event

import pytest

from boom_diagnosis import ahead
from boom_diagnosis.ahead import compiled_ahead
from boom_diagnosis.prediction import carrying
from boom_model.catalogue import CATALOGUE
from boom_model.errors import BuildError
from boom_model.machine import Machine
from boom_model.machine_file import load_machine

TZ17 = load_machine("tz17")


@pytest.fixture(autouse=True)
def _two_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ahead, "usable_cores", lambda: 2)


def test_the_models_that_a_look_at_all_effects_needs_are_compiled_the_machines_own_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked, all_done = list[tuple[tuple[str, ...], bool]](), Event()
    stateful = [e.id for e in CATALOGUE if e.states and TZ17.structure.has(e.needs)]

    def compiled(machine: Machine, *, sensitive: bool) -> None:
        asked.append((tuple(sorted(machine.effects)), sensitive))
        if len(asked) == 2 + len(stateful):
            all_done.set()

    monkeypatch.setattr(ahead, "compile_catalogued", compiled)
    with compiled_ahead(TZ17):
        assert all_done.wait(20.0)
    own = tuple(sorted(carrying(TZ17).effects))
    others = {(tuple(sorted(carrying(TZ17, [e]).effects)), False) for e in stateful}
    assert asked[0][0] == own and set(asked) == {(own, False), (own, True), *others}


def test_nothing_more_is_compiled_once_the_search_is_done(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, begun, left = list[tuple[str, ...]](), Event(), Event()
    monkeypatch.setattr(ahead, "Event", lambda: left)

    def compiled(machine: Machine, *, sensitive: bool) -> None:
        asked.append(tuple(machine.effects))
        begun.set()
        left.wait(20.0)

    monkeypatch.setattr(ahead, "compile_catalogued", compiled)
    with pytest.raises(KeyboardInterrupt), compiled_ahead(TZ17):
        assert begun.wait(20.0)
        raise KeyboardInterrupt
    assert len(asked) <= 2  # one a core


def test_a_compiler_that_is_missing_is_told_where_the_model_is_needed_and_not_here(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def compiled(*_: object, **__: object) -> None:
        raise BuildError("no C compiler")

    monkeypatch.setattr(ahead, "compile_catalogued", compiled)
    with compiled_ahead(TZ17):
        pass

"""Compiles models on cores that are idle, before the search asks for them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Event, Thread

from boom_diagnosis.parallel import in_parallel
from boom_diagnosis.prediction import carrying
from boom_diagnosis.search import possible_effects, side_by_side
from boom_model.catalogue import EFFECTS
from boom_model.compiled_model import compile_catalogued
from boom_model.cores import usable_cores
from boom_model.errors import BuildError, ModelError
from boom_model.machine import Machine


@contextmanager
def compiled_ahead(machine: Machine) -> Iterator[None]:
    """Within it, what a look at every effect needs is compiled on all cores, in the order of that look.

    On a machine seen for the first time that is half a minute of the compiler's time. What fails here fails again, with its
    reason, where it is needed.
    """
    done = Event()

    def compile_one(model: tuple[Machine, bool]) -> None:
        if not done.is_set():
            compile_catalogued(model[0], sensitive=model[1])

    def work() -> None:
        with suppress(BuildError, ModelError):
            first, *others = _models(machine)
            in_parallel(compile_one, [(first, False), (first, True), *((other, False) for other in others)])

    thread = Thread(target=work, name="compiler", daemon=True)
    if usable_cores() > 1 and not machine.learned:
        thread.start()
    try:
        yield
    finally:
        done.set()
        if thread.ident:
            thread.join()


def _models(machine: Machine) -> list[Machine]:
    """What is compiled: the machine as it is, then with each further set of states."""
    possible = possible_effects(machine.structure.has, tuple(machine.effects))
    stateful = [effect for effect, _ in side_by_side([(e, {}) for e in possible if EFFECTS[e].states])]
    return [carrying(machine, also) for also in ((), *([effect] for effect in stateful))]

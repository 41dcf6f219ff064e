"""What is diagnosed, and how far it has got."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.bag_samples import Bag
from boom_diagnosis.fitting import Point, Problem
from boom_diagnosis.freerun import Elsewhere
from boom_diagnosis.hypotheses import LOOSENESS, Nominal, Round, problem_at
from boom_diagnosis.learning import Learned, Setting
from boom_diagnosis.nuisances import Nuisance
from boom_diagnosis.search import Fitted
from boom_diagnosis.weighing import COLDEST, Weighed
from boom_model.machine import Machine, Pose
from boom_model.sensors import OUTPUTS

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass
class Case:
    """What is diagnosed, and how far it has got.

    Attributes:
        pose: of the first recording.
        bags: fitted. proving: not fitted at all. select: samples that the search goes by, per bag of ``bags``.
        training, judged: two parts of them; what is proved is fitted to the first and judged on the second. Without recordings
            that are held out the second is the end of each recording, else it is empty.
        elsewhere: blocks of long recordings that only the proof looks at.
        floor: loss per innovation of a healthy machine with the same currents. healthy: its recordings.
        rounds, weighed: what each round found, and its effects with what speaks for them. taken: those that earned their place.
        disproved: effects of the first round that gained enough, but made free runs over data not used worse, or gained it only on
            data held out, or only with a looser observer.
        impossible: effects of the first round as they were fitted, where no boom can have them so.
        trained: points with the first k effects, fitted to ``training`` alone.
        spared: number of effects -> fit with nominal tolerances, where moving them gains nothing.
        final: all effects at the point that the machine file gets, with all derivatives taken there.
        learned: a term that is plain to see and explains far more than any effect.
        own: numbers that are those of the recordings held out, by dotted name; see ``onset.own``.
    """

    machine: Machine
    pose: Pose
    bags: list[Bag]
    proving: list[Bag]
    select: list[Flags]
    training: list[Flags]
    judged: list[Flags]
    nuisances: tuple[Nuisance, ...]
    seed: int
    elsewhere: tuple[Elsewhere, ...] = ()
    floor: float = 0.0
    healthy: list[Bag] = field(default_factory=list)
    healthy_squares: Array = field(default_factory=lambda: np.ones(len(OUTPUTS)))
    rounds: list[Round] = field(default_factory=list)
    weighed: list[list[Weighed]] = field(default_factory=list)
    taken: list[Weighed] = field(default_factory=list)
    impossible: list[Fitted] = field(default_factory=list)
    trained: list[Point] = field(default_factory=list)
    disproved: list[Weighed] = field(default_factory=list)
    spared: dict[int, Point] = field(default_factory=dict)
    final: Fitted | None = None
    learned: Learned | None = None
    temperature: float = COLDEST
    own: dict[str, float] = field(default_factory=dict)

    def with_bags(self, bags: list[Bag], proving: list[Bag]) -> Case:
        """The case from its beginning, with the recordings prepared otherwise."""
        parts = self.select, self.training, self.judged, self.nuisances, self.seed, self.elsewhere
        return Case(self.machine, self.pose, bags, proving, *parts)

    def values(self, z: Array, effects: Mapping[str, float]) -> dict[str, float]:
        """Components of the parameter vector."""
        return self.rounds[0].problem.values(z, effects)

    def kept(self, k: int) -> Point:
        """The fit with the first ``k`` effects: with nominal tolerances where moving them gains nothing."""
        return self.spared.get(k) or (self.taken[k - 1].fitted.point if k else self.rounds[0].base)

    @property
    def named(self) -> tuple[str, ...]:
        """The effects that earned their place."""
        return tuple(w.fitted.effect for w in self.taken)

    @property
    def setting(self) -> Setting:
        """What a term is learnt from."""
        looseness = self.rounds[0].problem.predictor.looseness
        return Setting(self.machine, self.bags, self.training, self.judged, self.nuisances, self.proving, looseness)

    @property
    def last(self) -> Point:
        """The fit with everything that was found."""
        return self.final.point if self.final else self.kept(len(self.taken))

    def problem(self, z: Array, effects: Mapping[str, float], looseness: float) -> Problem:
        """Of all recordings that are fitted, with the observers' gains of this point."""
        return problem_at(self.machine, self.bags, self.select, self.nuisances, z, effects, looseness)

    @cached_property
    def nominal(self) -> Nominal:
        """What is seen from the nominal machine."""
        return Nominal(self.problem(np.zeros(len(self.nuisances)), {}, LOOSENESS[1]))

    def rest(self, at: Point) -> float:
        """Loss per innovation [nats] over that of a healthy machine, seen by the observer that is right for one."""
        return self.problem(at.z, at.effects, LOOSENESS[0]).points([(at.z, at.effects)])[0].excess(self.floor)

    def kept_back(self) -> Case:
        """A copy to go back to."""
        return replace(
            self, rounds=[*self.rounds], weighed=[*self.weighed], taken=[*self.taken], trained=[*self.trained],
            spared={**self.spared}, disproved=[*self.disproved], impossible=[*self.impossible],
        )  # fmt: skip

    def go_back(self, before: Case) -> None:
        """To what was found when the copy was made."""
        self.rounds, self.weighed, self.taken = before.rounds, before.weighed, before.taken
        self.trained, self.spared, self.disproved = before.trained, before.spared, before.disproved
        self.impossible, self.temperature, self.own = before.impossible, before.temperature, before.own

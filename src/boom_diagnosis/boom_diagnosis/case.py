"""What is diagnosed, and how far it has got."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from boom_diagnosis.bag_samples import Bag, by_pose
from boom_diagnosis.fitting import WHITE, Point, Problem
from boom_diagnosis.found_machine import TOLD
from boom_diagnosis.freerun import Elsewhere
from boom_diagnosis.hypotheses import LOOSENESS, Nominal, Round, problem_at
from boom_diagnosis.learning import Learned, Setting
from boom_diagnosis.nuisances import Nuisance, clock, clocks, of_pose, tolerances
from boom_diagnosis.onset import moments
from boom_diagnosis.recent import Recent
from boom_diagnosis.search import Fitted
from boom_diagnosis.sizes import MachineSize, size_of
from boom_diagnosis.weighing import COLDEST, Weighed
from boom_estimation.free_run import plant_for
from boom_model.catalogue import EFFECTS
from boom_model.machine import Machine, Pose
from boom_model.sensors import OUTPUTS

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
HELD_OUT_SHARE = 1.0 / 3.0
"""Of each recording, its end, where no recording is held out."""
POINTS = 8
"""Of which the moments of other poses are kept."""


@dataclass(frozen=True)
class Opened:
    """A number of the machine file as if nothing were known of it, fitted with tolerances alone.

    rest: loss per innovation over that of a healthy machine. away: logarithm of the number over the file's; within: standard
    deviation of that. strain: nats by which tolerances are strained beside it. loss: what it leaves, of their priors too [nats].
    """

    number: Nuisance
    case: Case
    rest: float
    away: float
    within: float
    strain: Callable[[], float] = lambda: 0.0
    loss: Callable[[], float] = lambda: 0.0


@dataclass
class Case:
    """What is diagnosed, and how far it has got.

    Attributes:
        pose: of the first recording. others: end of the names of another pose's numbers -> that pose.
        bags: fitted. proving: not fitted at all. select: samples that the search goes by, per bag of ``bags``.
        training, judged: two parts of them; what is proved is fitted to the first and judged on the second. Without recordings
            that are held out the second is the end of each recording, else it is empty.
        elsewhere: blocks of long recordings that only the proof looks at.
        floor: loss per innovation of a healthy machine with the same currents, of white noise until it is known. healthy: its
            recordings.
        rounds, weighed: what each round found, and its effects with what speaks for them. taken: those that earned their place.
        disproved: effects of the first round that gained enough, but made free runs over data not used worse, or gained it only on
            data held out, or only with a looser observer, or may do nothing where nothing is left.
        impossible: effects of the first round as they were fitted, where no boom can have them so.
        trained: points with the first k effects, fitted to ``training`` alone.
        spared: number of effects -> fit with nominal tolerances, where moving them gains nothing.
        final: all effects at the point that the machine file gets, with all derivatives taken there.
        sharpest: its point before it was fitted to free runs, if it was: what one-step errors it leaves.
        likeliest: parameters only as the likeliest observer fits them, to all and to ``training``, where the first round was looked
            at again with the observer that sees most.
        plain: parameters only that are handed out, where they are not those of the first round; ``sharpest`` are those, then.
        learned: a term that is plain to see and explains far more than any effect.
        oftener: T_s [s] of a controller that commands more or less often than the file says (``straying``); 0: as it says.
        own: numbers that are those of the recordings held out, by dotted name; see ``onset.own``.
        wrong: number of the machine file of which nothing is taken for known, and those that share its factor (``wrong_number``).
        filed: the case as it ended with the file's number, where one is wrong.
        or_wrong: others that explain the recordings as well, and by which factor they would be off. opened: what has been tried.
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
    others: Mapping[str, Pose] = field(default_factory=dict)
    elsewhere: tuple[Elsewhere, ...] = ()
    floor: float = WHITE
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
    sharpest: Point | None = None
    likeliest: tuple[Point, Point] | None = None
    plain: Point | None = None
    learned: Learned | None = None
    temperature: float = COLDEST
    oftener: float = 0.0
    own: dict[str, float] = field(default_factory=dict)
    wrong: tuple[str, ...] = ()
    filed: Case | None = field(default=None, repr=False)
    or_wrong: tuple[tuple[tuple[str, ...], float], ...] = ()
    opened: list[Opened] | None = None
    _own_moments: Recent[Array] = field(default_factory=lambda: Recent(POINTS), repr=False)

    def with_bags(self, bags: list[Bag], proving: list[Bag]) -> Case:
        """The case from its beginning, with the recordings prepared otherwise."""
        parts = self.select, self.training, self.judged, self.nuisances, self.seed, self.others, self.elsewhere
        return Case(
            self.machine, self.pose, bags, proving, *parts, oftener=self.oftener, wrong=self.wrong, filed=self.filed,
            or_wrong=self.or_wrong,
        )  # fmt: skip

    def with_wrong(self, number: Nuisance) -> Case:
        """The case from its beginning, with a number of the machine file free."""
        nuisances = (number, *(n for n in self.nuisances if n.name != number.name))
        parts = self.select, self.training, self.judged, nuisances, self.seed, self.others, self.elsewhere
        return Case(
            self.machine, self.pose, self.bags, self.proving, *parts, oftener=self.oftener, wrong=number.components
        )

    def values(self, z: Array, effects: Mapping[str, float]) -> dict[str, float]:
        """Components of the parameter vector."""
        return self.rounds[0].problem.values(z, effects)

    def numbers(self, z: Array, effects: Mapping[str, float]) -> dict[str, float]:
        """Components for a machine file: a load that is another than told is in the moments of mass of its pose.

        Of several loads in one pose each is told by itself (``payload.told``).

        Moments of a pose that no fitted recording has are those of z: :meth:`everywhere` has them as recordings held out tell them.
        """
        result = self.values(z, effects)
        known = {n.name: n.nominal for n in self.nuisances if n.nominal is not None}
        carried: dict[str, dict[str, float]] = {}
        for bag in (*self.bags, *self.proving):
            carried.setdefault(bag.pose_end, {})[bag.places["pose.load"]] = bag.load_told
        several = {name: told for loads in carried.values() if len(loads) > 1 for name, told in loads.items()}
        result |= {f"{TOLD}{told}": result[name] for name, told in several.items() if name in result}
        for end, loads in carried.items():
            load = min(loads)
            if load in several or load not in result:  # moments of one pose do not tell two loads
                continue
            more = result[load] - known[load]
            x, y = self.others.get(end, self.pose).tip
            for name, there in (("D0", x**2 + y**2), ("Sx", x), ("Sy", y)):
                own = f"pose.{name}{end}"
                result[own] = result.get(own, known.get(own, 0.0)) + more * there
        return result

    def of_held_out_alone(self) -> list[int]:
        """Which numbers are those of poses and loads that only recordings held out have."""
        fitted = {name for bag in self.bags for name in bag.places.values()}
        return [i for i, n in enumerate(self.nuisances) if n.nominal is not None and n.name not in fitted]

    def everywhere(self, at: Point) -> Array:
        """z at a point, with these numbers as those recordings tell them."""
        which = self.of_held_out_alone()
        if not which:
            return at.z
        plain = {n: v for n, v in at.effects.items() if n.startswith("effects.")}  # a learnt term is another machine's
        effects = {**plain, **self.own_beside(at)}
        counted = [bag.counted for bag in self.proving]
        return self._own_moments.get(
            (at.z.tobytes(), *sorted(effects.items())),
            lambda: moments(
                problem_at(self.machine, self.proving, counted, self.nuisances, at.z, effects, LOOSENESS[0]),
                at.z, effects, which,
            ),
        )  # fmt: skip

    def own_beside(self, at: Point) -> dict[str, float]:
        """Numbers of effects that are those of the recordings held out; of a load only where the point has it."""
        return {name: v for name, v in self.own.items() if name in at.effects or not EFFECTS[name.split(".")[1]].load}

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

    @cached_property
    def size(self) -> MachineSize:
        """With which the catalogue's ranges go."""
        return size_of(self.machine)

    @property
    def last(self) -> Point:
        """The fit with everything that was found."""
        return self.final.point if self.final else self.plain or self.kept(len(self.taken))

    def problem(self, z: Array, effects: Mapping[str, float], looseness: float) -> Problem:
        """Of all recordings that are fitted, with the observers' gains of this point."""
        return problem_at(self.machine, self.bags, self.select, self.nuisances, z, effects, looseness)

    @cached_property
    def nominal(self) -> Nominal:
        """What is seen from the nominal machine."""
        wrong = [i for i, n in enumerate(self.nuisances) if n.components == self.wrong]
        return Nominal(self.problem(np.zeros(len(self.nuisances)), {}, LOOSENESS[1]), wrong=wrong)

    def ended(self, at: Point) -> Flags:
        """(count,) which tolerances stand at their ends."""
        return np.array([n.ended(float(z)) for n, z in zip(self.nuisances, at.z, strict=True)], dtype=bool)

    def rest(self, at: Point) -> float:
        """Loss per innovation [nats] over that of a healthy machine, seen by the observer that is right for one."""
        return self.problem(at.z, at.effects, LOOSENESS[0]).points([(at.z, at.effects)])[0].excess(self.floor)

    def kept_back(self) -> Case:
        """A copy to go back to."""
        return replace(
            self, rounds=[*self.rounds], weighed=[*self.weighed], taken=[*self.taken], trained=[*self.trained],
            spared={**self.spared}, disproved=[*self.disproved], impossible=[*self.impossible],
        )  # fmt: skip

    def without_effects(self) -> Case:
        """As it would be had nothing been found beside the tolerances."""
        return replace(
            self, rounds=self.rounds[:1], weighed=[], taken=[], trained=self.trained[:1], final=None, sharpest=None, learned=None,
            spared={k: point for k, point in self.spared.items() if k == 0},
        )  # fmt: skip

    def go_back(self, before: Case) -> None:
        """To what was found when the copy was made."""
        self.rounds, self.weighed, self.taken = before.rounds, before.weighed, before.taken
        self.trained, self.spared, self.disproved = before.trained, before.spared, before.disproved
        self.impossible, self.temperature, self.own = before.impossible, before.temperature, before.own


def case_of(machine: Machine, bags: Sequence[Bag], proving: Sequence[Bag], seed: int) -> Case:
    """The case of recordings, before anything is searched.

    Raises:
        MachineError: a pose or load that the machine cannot have.
    """
    placed = by_pose([*bags, *proving])
    bags, proving = placed[: len(bags)], placed[len(bags) :]
    pose = plant_for(bags[0].recording, machine, "full").pose
    select = [bag.counted.copy() for bag in bags]
    later = [
        np.zeros_like(bag.time, dtype=bool) if proving else bag.time >= (1.0 - HELD_OUT_SHARE) * bag.recording.duration
        for bag in bags
    ]
    training = [s & ~end[:, None] for s, end in zip(select, later, strict=True)]
    judged = [s & end[:, None] for s, end in zip(select, later, strict=True)]
    logs = (*clock(machine, [bag.currents for bag in bags]), *clocks(bag.lacking for bag in bags))
    known = {n.name: n for n in (*tolerances(machine, pose), *logs)}
    others: dict[str, Pose] = {}
    for bag in placed:
        own = plant_for(bag.recording, machine, "full").pose
        for n in of_pose(machine, own):
            name = bag.places[n.name]
            known.setdefault(name, replace(n, name=name))
        if bag.pose_end:
            others.setdefault(bag.pose_end, own)
    return Case(machine, pose, bags, proving, select, training, judged, tuple(known.values()), seed, others)

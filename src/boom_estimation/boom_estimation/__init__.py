"""Estimation of parameters from recordings: the engine of identification and diagnosis.

    experiments = [prepare(recording, machine) for recording in recordings]
    problem = EstimationProblem(experiments, [machine_unknown(machine, "friction.tau_C_pos"), effect_unknown("payload", "mass")])
    result = fit(problem)

Effects that are estimated must be present in the machine (``with_effects_present``). See docs/identification.md.
"""

from boom_estimation.experiment import PreparedRecording, Segment, last_part, prepare
from boom_estimation.fit import FitResult, fit
from boom_estimation.problem import EstimationProblem
from boom_estimation.unknown import Unknown, effect_unknown, machine_unknown, with_effects_present
from boom_estimation.whitening import PredictorGains, gains

__all__ = [
    "EstimationProblem", "FitResult", "PredictorGains", "PreparedRecording", "Segment", "Unknown", "effect_unknown", "fit",
    "gains", "last_part", "machine_unknown", "prepare", "with_effects_present",
]  # fmt: skip

"""The words that a report uses, each in a sentence: its last section. docs/glossary.md has them all."""

from __future__ import annotations

from markupsafe import Markup

from boom_report.templates import render

_SENTENCES = {
    "free run": "A simulation from an initial state with the measured currents only; no measurement corrects it.",
    "full model, reduced model": "All eleven states; the eight on which the controller is designed.",
    "hose pressure, rod pressure": "p_h between main valve and cylinder, on the side that lifts; p_b on the side of the rod.",
    "q2, q3, q4": "Angle of the boom, up is positive, 0 rad is horizontal; outer boom's angle and telescope's length, locked.",
    "extend, retract": "The current that lifts the boom, and the one that lowers it.",
    "noise limit": "The error that a right model still shows, because sensors are noisy.",
    "MAE, rms, RMSE, MAXE": "Mean absolute, root mean square (twice) and largest absolute error.",
    "NRMSE": "Rms error over the standard deviation of what was measured: 0 is perfect, 1 is no better than the mean.",
    "tolerance": "How far a number of the machine file may be off before the machine counts as another one.",
    "held out": "Data that nothing was fitted to: what a finding is proved on.",
    "effect": "Physics that the machine file leaves out, of a catalogue with equations.",
    "confidence": "The probability that a finding is right; of all that are given 0.9, nine in ten should be.",
    "noise floor": "The error of a simulated healthy machine with the same currents: less is not to be had.",
    "sigma": "Standard deviation of a sensor's noise.",
    "nat": "Unit of log-likelihood: a gain of 1 makes the data 2.7 times as likely.",
    "regime": "A part of the recording by what the boom does: direction, speed, pressure.",
    "excitation": "How much a recording moves the machine: what does not move cannot be estimated.",
    "90 % interval": "The range that holds the true value in nine of ten cases.",
    "law": "A formula for the flow through the valve at the cylinder.",
    "signal, column": "What every command expects; what the foreign file has.",
    "gauge, absolute": "Pressure above that of the air; above vacuum, about 1 bar more.",
    "C0 to C4": "Plants of Table 6.2: C0 as in the machine file; the others with 2000 kg and other oil, gas pressure and friction.",
    "control law": "How the controller computes the currents: thesis, baseline, improved, simple.",
    "detectability": "1 x: as much energy in the recording as all noise, after what no number within tolerance could imitate.",
    "oracle": "The second plant itself on the measured currents: no model predicts better.",
    "gap or fault": "Samples that are missing, stuck or impossible; they are masked and count nowhere.",
}  # fmt: skip


def section(*words: str) -> Markup:
    """HTML of a section that explains these words.

    Raises:
        KeyError: a word that no sentence explains.
    """
    return render("boom_report/terms.html", entries=[(word, _SENTENCES[word]) for word in words])

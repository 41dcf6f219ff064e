"""Diagnosis: where a model and recordings differ, which physics was left out, and the proof on data not used."""

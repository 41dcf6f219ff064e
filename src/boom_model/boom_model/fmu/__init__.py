"""A machine in a pose as a Functional Mock-up Unit for co-simulation, FMI 2.0 and 3.0."""

"""CasADi expressions as C, compiled once, with the integrators and the observer."""

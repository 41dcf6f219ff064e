"""The second concealed plant, Q: an own crane whose structure, operator, sensors and forms of effects are drawn at random."""

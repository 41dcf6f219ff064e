"""A second crane model for blind trials. It shares no line with boom_model and must never import it, nor be imported by it."""

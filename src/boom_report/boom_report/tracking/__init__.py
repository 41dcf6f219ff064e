"""How well a boom followed its reference."""

"""The cascade controller of the inner boom (thesis ch. 6): references, control laws, supervision, node."""

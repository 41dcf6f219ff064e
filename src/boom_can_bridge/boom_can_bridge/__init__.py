"""The bridge between the machine's CAN bus and the topics: codec, checks, command gate, and the node."""

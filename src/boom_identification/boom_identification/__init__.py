"""Chapter 5 as a tool: parameters of the machine from recordings, with intervals and what they cannot tell."""

"""Chapter 5: estimates parameters of the machine from recordings, with intervals and the numbers that they do not determine."""

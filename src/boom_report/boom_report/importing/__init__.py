"""The page of an import: what each signal was taken from, and how it looks."""

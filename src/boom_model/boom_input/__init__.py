"""What all share: files read within limits and written whole, and the table of channels. Knows no other package."""

"""Foreign recordings become recordings of the contract: readers, a mapping, and a proposal for it where none is given."""

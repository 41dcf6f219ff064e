"""One module for each kind of file; `boom_import.reading` chooses."""

"""Free runs beside a recording: Tables 5.1 and 5.2."""

"""Coast-down runs to a road load."""

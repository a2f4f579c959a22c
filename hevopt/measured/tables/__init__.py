"""Tables of any shape to columns with names and units."""

"""Points of a test bench to maps of engines and machines."""

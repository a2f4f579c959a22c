"""The real cars held against the laboratory: what was measured, what the model makes of it, what lies between."""

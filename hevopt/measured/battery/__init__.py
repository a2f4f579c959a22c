"""Batteries from their tests: open-circuit voltage and resistance over charge, direction and temperature."""

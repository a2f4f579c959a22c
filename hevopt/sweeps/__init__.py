"""Sweeps: many designs of one car, each solved once, stored at once, and compared."""

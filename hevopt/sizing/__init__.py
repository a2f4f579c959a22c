"""Sizes of engine, machine and battery: what no car of a range of them burns less than."""

"""Gearboxes from what a test bench says they lose, over gear, speed and torque."""

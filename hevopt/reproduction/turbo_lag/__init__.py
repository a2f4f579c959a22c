"""The published tip-in study beside ours, and the torque hole filled by the machines of its hybrids."""

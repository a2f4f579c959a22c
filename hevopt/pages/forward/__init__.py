"""Pages of cars driven forward: along a trace, and at full pedal."""

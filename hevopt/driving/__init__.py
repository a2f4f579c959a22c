"""What is asked of a car: the cycle, the demand at the wheels, and the driver's gears."""

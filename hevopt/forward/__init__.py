"""The car driven by somebody: driver, clutch, tyre and driveline in time steps of a hundredth of a second."""

"""What a car's file says of its rules; whatever it leaves open is calibrated on the cycle."""

from typing import NamedTuple


class Thresholds(NamedTuple):
    """Up to where the rules drive electrically, None where it is calibrated.

    electric_soc: only above this state of charge; electric_power_w, electric_speed_mps: at the wheels
    """

    electric_soc: float | None = None
    electric_power_w: float | None = None
    electric_speed_mps: float | None = None


OPEN = Thresholds()

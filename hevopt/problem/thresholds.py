"""What a car's file says of its rules; whatever it leaves open is calibrated on the cycle."""

from typing import NamedTuple


class Thresholds(NamedTuple):
    """Thresholds of the rules, None where one is calibrated.

    electric_soc: only above this state of charge the car is driven electrically
    electric_power_w, electric_speed_mps: and up to this power and speed, at the wheels
    engine_on_power_w, engine_off_power_w: asked power above which the engine starts, and below which it stops
    charge_power_w: what half a window of missing charge adds to the asked power
    reference_soc: state of charge at which nothing is missing
    thermostat_on_soc, thermostat_off_soc: the engine charges below the one until the other
    """

    electric_soc: float | None = None
    electric_power_w: float | None = None
    electric_speed_mps: float | None = None
    engine_on_power_w: float | None = None
    engine_off_power_w: float | None = None
    charge_power_w: float | None = None
    reference_soc: float | None = None
    thermostat_on_soc: float | None = None
    thermostat_off_soc: float | None = None

    @property
    def electric(self) -> tuple[float | None, float | None, float | None]:
        """Up to where the car is driven electrically: state of charge, power and speed."""
        return self[:3]

    @property
    def socs(self) -> dict[str, float]:
        """The states of charge among them that are given, by their keys."""
        return {
            key: value
            for key, value in self._asdict().items()
            if key.endswith("_soc") and value is not None
        }


OPEN = Thresholds()

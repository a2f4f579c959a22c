"""Engines of another size by the number of their cylinders, as car/engine.py has them, turbocharger to match.

Displacement, contents, areas and heat flows are k times as large, wheels sqrt(k) times; H of pressure losses 1/k².
With the rotor's inertia and friction k² times as large, pressures over time are the same and torques k times. A
similar rotor has sqrt(k)^5 times the inertia, which is taken here: larger engines lag more.
"""

from hevopt.mean_value.parameters import (
    FULL_LOAD,
    Diesel,
    Engine,
    Volumes,
    Wall,
    curve_of,
    with_curve,
)


def scaled(diesel: Diesel, factor: float) -> Diesel:
    """The engine with `factor` times the displacement, at equal mean pressures and piston speeds."""
    engine, k = diesel.engine, factor
    losses = engine.restrictions
    compressor, turbine, rotor = engine.compressor, engine.turbine, engine.rotor
    larger = Engine(
        Volumes(*(k * volume for volume in engine.volumes)),
        losses._replace(
            filter_h=losses.filter_h / k**2,
            intercooler_h=losses.intercooler_h / k**2,
            exhaust_h=losses.exhaust_h / k**2,
        ),
        engine.intercooler,
        compressor._replace(wheel_diameter_m=k**0.5 * compressor.wheel_diameter_m),
        turbine._replace(
            wheel_radius_m=k**0.5 * turbine.wheel_radius_m, area_m2=k * turbine.area_m2
        ),
        rotor._replace(
            inertia_kgm2=k**2.5 * rotor.inertia_kgm2, bearing_nms=k**2 * rotor.bearing_nms
        ),
        engine.cylinders._replace(displacement_m3=k * engine.cylinders.displacement_m3),
        engine.recirculation._replace(area_m2=k * engine.recirculation.area_m2),
        Wall(*(k * value for value in engine.wall)),
    )
    speed, torque = curve_of(diesel.curves, FULL_LOAD)
    return Diesel(larger, diesel.control, with_curve(diesel.curves, FULL_LOAD, speed, k * torque))

"""Engines and machines of another size, by one factor k; speeds stay.

Engine (Willans scaling; L. Guzzella, A. Sciarretta, Vehicle Propulsion Systems, Springer, section 3.1: brake and
fuel mean pressure over mean piston speed are those of a family of engines, whatever their size). The stroke stays,
and the number of cylinders changes by k: at equal speed the piston speed is the same, at equal mean pressure the
efficiency. So displacement, full load, drag and power are k times as large at every speed, and

    fuel_k(k T, w) = k fuel(T, w)    NOx_k(k T, w) = k NOx(T, w)    inertia, fuel of a start: k times

The factor may be called that of displacement, torque or power: with speeds unchanged the three are one.

Machine (another active length, windings and inverter to match): torque and power limits and inertia are k times,

    loss_k(k T, w) = k loss(T, w)

so that of c0 + c1 w + c2 w² + c3 T² the first three grow by k and c3 falls by it. Efficiency is the same at the
same share of the limits; torque and power have one factor, speeds unchanged.
"""

from dataclasses import replace

from hevopt.car.engine import Engine, EngineGrid
from hevopt.car.machine import LossGrid, Machine


def scaled_engine(engine: Engine, factor: float) -> Engine:
    """The engine with `factor` times the displacement, at equal mean pressures and piston speeds."""
    fuel = engine.fuel
    if isinstance(fuel, EngineGrid):
        fuel = replace(
            fuel,
            torque_nm=factor * fuel.torque_nm,
            fuel_kgps=factor * fuel.fuel_kgps,
            nox_kgps=None if fuel.nox_kgps is None else factor * fuel.nox_kgps,
            motoring_torque_nm=factor * fuel.motoring_torque_nm,
        )
    return replace(
        engine,
        displacement_m3=factor * engine.displacement_m3,
        inertia_kgm2=factor * engine.inertia_kgm2,
        start_fuel_kg=factor * engine.start_fuel_kg,
        full_load_torque_nm=factor * engine.full_load_torque_nm,
        fuel=fuel,
    )


def scaled_machine(machine: Machine, factor: float) -> Machine:
    """The machine with `factor` times the torque and power, at equal speeds and efficiencies."""
    loss = machine.loss
    if isinstance(loss, LossGrid):
        loss = replace(loss, torque_nm=factor * loss.torque_nm, loss_w=factor * loss.loss_w)
    elif loss is not None:
        c0, c1, c2, c3 = loss
        loss = (factor * c0, factor * c1, factor * c2, c3 / factor)
    curve = machine.full_load
    return replace(
        machine,
        power_max_w=factor * machine.power_max_w,
        torque_max_nm=factor * machine.torque_max_nm,
        inertia_kgm2=factor * machine.inertia_kgm2,
        loss=loss,
        full_load=None if curve is None else replace(curve, torque_nm=factor * curve.torque_nm),
    )

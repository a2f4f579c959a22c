"""The mean-value equations a second time, in plain scalar Python from the engine's file; no code of hevopt's.

A state is a list of numbers in the order of NAMES; SECOND_PIPE behind them where the charge pipe has two halves.
"""

import tomllib
from math import exp, pi, sqrt, tanh
from pathlib import Path

from scipy.integrate import solve_ivp

R = 287.0
P_AIR, T_AIR = 101_325.0, 298.15
NAMES = (
    "m1 b1 U1 m2 b2 U2 m3 b3 U3 m4 b4 U4 m5 b5 U5 turbo wall vanes egr meter boost pedal engine road tyre"
).split()
SECOND_PIPE = ["m6", "b6", "U6"]


def cp_of(t, x):
    return (943.0 * (1 - x) + 985.0 * x) + (0.206 * (1 - x) + 0.290 * x) * t


def h_of(t, x):
    return (943.0 * (1 - x) + 985.0 * x) * t + (0.206 * (1 - x) + 0.290 * x) * t * t / 2


def gas(m, b, energy, volume):
    x = b / m
    a, slope = 943.0 * (1 - x) + 985.0 * x - R, 0.206 * (1 - x) + 0.290 * x
    u = energy / m
    t = (-a + sqrt(a * a + 2 * slope * u)) / slope
    return {
        "p": m * R * t / volume,
        "t": t,
        "x": x,
        "rho": m / volume,
        "h": h_of(t, x),
        "cp": cp_of(t, x),
    }


def table(x, points, values):
    if x <= points[0]:
        return values[0]
    for n in range(1, len(points)):
        if x <= points[n]:
            share = (x - points[n - 1]) / (points[n] - points[n - 1])
            return values[n - 1] + share * (values[n] - values[n - 1])
    return values[-1]


def soft_root(q, q0):
    return sqrt(q) if q > q0 else sqrt(q0) * (1.25 * (q / q0) - 0.25 * (q / q0) ** 3)


class PlainCar:
    """A car in a gear by its figures; pedal(t) drives it."""

    def __init__(
        self, engine_file: Path, mass, wheels, radius, c0, c1, drag, rho, ratio, efficiency
    ):
        self.file = tomllib.loads(engine_file.read_text())
        self.mv = self.file["mean_value"]
        self.k = ratio / radius
        self.m = mass + wheels / radius**2
        self.road = lambda v: mass * 9.80665 * (c0 + c1 * v) + rho * drag / 2 * v * v
        self.eta = efficiency
        self.clutch = 1.5 * max(self.file["full_load"]["torque_nm"])
        self.rate = 0.0
        self.hold = None
        # Pressure loss between two halves of the charge pipe; none: it is one volume.
        self.join = None

    def best(self, cm):
        """Indicated efficiency with much air."""
        c = self.mv["cylinders"]
        return c["efficiency"] * (
            1 - ((cm - c["efficiency_best_mps"]) / c["efficiency_width_mps"]) ** 2
        )

    def full(self, w):
        curve = self.file["full_load"]
        return table(w * 30 / pi, curve["speed_rpm"], curve["torque_nm"])

    def compressor(self, w, one, two):
        c = self.mv["compressor"]
        d, n = c["wheel_diameter_mm"] / 1e3, c["head_exponent"]
        u = w * d / 2
        mach = u / sqrt(1.4 * R * one["t"])
        phi_s = c["surge_flow"] + c["surge_flow_per_mach"] * mach
        phi_c = c["choke_flow"] - c["choke_flow_fall_per_mach"] * mach
        dh = one["cp"] * one["t"] * ((two["p"] / one["p"]) ** (R / one["cp"]) - 1)
        s = 1 - dh / u**2 / c["head_max"]
        if s > 1:
            x = sqrt(1 + 2 / n * (s - 1))
        elif s > 0.02:
            x = s ** (1 / n)
        else:
            x = 0.02 ** (1 / n) * (1 + (s / 0.02 - 1) / n)
            assert x > 0, "beyond surge: not in this test"
        phi = phi_s + x * (phi_c - phi_s)
        disc = one["rho"] * pi / 4 * d * d * u
        flow = phi * disc
        power = (
            u
            * u
            * (flow * (c["work"] - c["work_fall_with_flow"] * phi) + c["disc_friction"] * disc)
        )
        return flow, power

    def turbine(self, w, vanes, four, five):
        c = self.mv["turbine"]
        pi_t = five["p"] / four["p"]
        q = 1 - pi_t ** c["flow_exponent"]
        flow = c["area_cm2"] / 1e4 * vanes * four["p"] / sqrt(R * four["t"]) * soft_root(q, 1e-3)
        dh = four["cp"] * four["t"] * (1 - pi_t ** (R / four["cp"]))
        z = w * c["wheel_diameter_mm"] / 2e3 / sqrt(2 * dh) / c["blade_speed_ratio"]
        return flow, flow * dh * c["efficiency_max"] * z * (2 - z)

    def fuel_and_commands(self, w, pedal, into, y, three, four):
        c, cyl = self.mv["control"], self.mv["cylinders"]
        rpm, vd = w * 30 / pi, self.file["displacement_cm3"] / 1e6
        q_lhv = self.file["fuel"]["heating_value_mjpkg"] * 1e6
        cm = 2 * self.file["stroke_mm"] / 1e3 * rpm / 60
        fmep = 1e5 * (cyl["friction_bar"] + cyl["friction_bar_s2pm2"] * cm**2)
        pmep = 1e5 * (c["pumping_bar"] + c["pumping_bar_1000rpm"] * (rpm / 1000) ** 2)
        eta = self.best(cm) * (c["efficiency_fall"] - c["efficiency_fall_with_load"] * pedal)
        asked = (4 * pi * pedal * self.full(w) / vd + fmep + pmep) * vd / eta / q_lhv
        air = into * (1 - three["x"]) * 4 * pi / w
        most = air / cyl["stoichiometric_air"] / table(rpm, c["smoke_rpm"], c["smoke_lambda"])
        fuel = min(asked, most) * min(
            max(1 - (four["t"] - c["exhaust_temperature_max_k"]) / 50, 0), 1
        )
        last = c["lambda_load"][-1]
        lam = table(pedal, c["lambda_load"], c["lambda_part_load"])
        if pedal > last:
            lam += (
                (pedal - last)
                / (1 - last)
                * (table(rpm, c["lambda_rpm"], c["lambda_full_load"]) - lam)
            )
        fill = cyl["filling_max"] - cyl["filling_fall"] * (rpm / cyl["filling_speed_rpm"] - 1) ** 2
        target = asked * cyl["stoichiometric_air"] * lam * R * c["charge_k"] / (fill * vd)
        e = (target - three["p"]) / 1e5
        base = table(rpm, c["vanes_rpm"], c["vanes"]) * (1 + c["vanes_growth"] * (1 - pedal))
        base += max(four["p"] / 1e5 - c["exhaust_pressure_max_bar"], 0)
        on = min(max((pedal - c["boost_from_load"]) / 0.05, 0), 1)
        base -= on * (c["boost_gain_pbar"] * e + y["boost"])
        room = base - c["vanes_least"] if e > 0 else 1 - base
        growth = (
            on * c["boost_integral_pbars"] * e * min(max(room / 0.02, 0), 1) - (1 - on) * y["boost"]
        )
        vanes = min(max(base, c["vanes_least"]), 1.0)
        egr = table(pedal, c["egr_load"], c["egr_opening"])
        egr *= min(
            max((c["egr_closed_rpm"] - rpm) / (c["egr_closed_rpm"] - c["egr_fades_rpm"]), 0), 1
        )
        egr *= min(max((most / asked - 1) / 0.1, 0), 1)
        return fuel * w / 4 / pi, vanes, egr, growth

    def rates(self, t, values):
        y = self.named(values)
        mv, cyl = self.mv, self.mv["cylinders"]
        litres = list(mv["volumes"].values())
        one, two, three, four, five = (
            gas(y[f"m{n}"], y[f"b{n}"], y[f"U{n}"], litres[n - 1] / 1e3) for n in range(1, 6)
        )
        air = {"p": P_AIR, "t": T_AIR, "x": 0.0, "rho": P_AIR / R / T_AIR, "h": h_of(T_AIR, 0.0)}
        limit = mv["restrictions"]["linear_below_pa"]
        halves = self.join is not None
        late = gas(y["m6"], y["b6"], y["U6"], litres[1] / 1e3) if halves else two

        def loss(a, b, h):
            up, sign = (a, 1) if a["p"] >= b["p"] else (b, -1)
            return sign * sqrt(up["rho"] / h) * soft_root(abs(a["p"] - b["p"]), limit)

        def of(w, a, b, what):
            return w * (a if w > 0 else b)[what]

        w, turbo = y["engine"], y["turbo"]
        vd, rpm = self.file["displacement_cm3"] / 1e6, w * 30 / pi
        rc = mv["compression_ratio"]
        fill = cyl["filling_max"] - cyl["filling_fall"] * (rpm / cyl["filling_speed_rpm"] - 1) ** 2
        fill *= (rc - (four["p"] / three["p"]) ** (1 / 1.35)) / (rc - 1)
        into = fill * three["p"] * vd * w / (4 * pi * R * three["t"])
        pedal = min(y["pedal"] + self.rate * t, 1.0)
        fuel, vanes, egr_open, growth = self.fuel_and_commands(w, pedal, into, y, three, four)
        w1, w3, w5 = (
            loss(air, one, mv["restrictions"]["filter_pm4"]),
            loss(late, three, mv["restrictions"]["intercooler_pm4"]),
            loss(five, air, mv["restrictions"]["exhaust_pm4"]),
        )
        wc, pc = self.compressor(turbo, one, two)
        wt, pt = self.turbine(turbo, y["vanes"], four, five)
        valve = mv["recirculation"]
        up, down, sign = (four, three, 1) if four["p"] >= three["p"] else (three, four, -1)
        ratio, least = (
            max(down["p"] / up["p"], valve["least_pressure_ratio"]),
            valve["least_pressure_ratio"],
        )
        we = sign * valve["area_mm2"] / 1e6 * y["egr"] * up["p"] / sqrt(R * up["t"])
        we *= 1 - ((1 - ratio) / (1 - least) - 1) ** 2

        afs, q = cyl["stoichiometric_air"], self.file["fuel"]["heating_value_mjpkg"] * 1e6
        lam = into * (1 - three["x"]) / (afs * fuel)
        burn = min(lam, 1) * fuel * q
        cm = 2 * self.file["stroke_mm"] / 1e3 * rpm / 60
        indicated = (
            self.best(cm)
            * (1 - cyl["rich_loss"] * exp(-(max(lam, 1) - 1) / cyl["rich_width"]))
            * burn
        )
        pumping = four["p"] - three["p"] + cyl["gas_exchange_bar"] * 1e5 * (rpm / 2000) ** 2
        fmep = 1e5 * (cyl["friction_bar"] + cyl["friction_bar_s2pm2"] * cm**2)
        piston = indicated - pumping * vd * w / 4 / pi
        torque = (piston - fmep * vd * w / 4 / pi) / w
        q_wall = (cyl["wall_share"] + cyl["wall_share_1000rpm"] * 1000 / rpm) * burn
        exhaust_h = into * three["h"] + burn - piston - q_wall
        made = min(fuel * (1 + afs), fuel + into * (1 - three["x"]))

        cool, ecool = mv["intercooler"], mv["recirculation"]
        t_c = late["t"] - cool["effectiveness"] * (late["t"] - cool["coolant_k"])
        t_e = four["t"] - ecool["effectiveness"] * (four["t"] - ecool["coolant_k"])
        into3 = w3 * (h_of(t_c, late["x"]) if w3 > 0 else three["h"])
        egr3 = we * (h_of(t_e, four["x"]) if we > 0 else three["h"])
        q4 = mv["exhaust_wall"]["gas_wpk"] * (four["t"] - y["wall"])
        d = dict.fromkeys(y, 0.0)
        w2 = loss(two, late, self.join) if halves else w3
        d["m1"], d["m2"], d["m3"] = w1 - wc, wc - w2, w3 + we - into
        d["m4"], d["m5"] = into + fuel - wt - we, wt - w5
        d["b1"] = of(w1, air, one, "x") - of(wc, one, two, "x")
        behind = late if halves else three
        d["b2"] = of(wc, one, two, "x") - of(w2, two, behind, "x")
        d["b3"] = of(w3, late, three, "x") + of(we, four, three, "x") - into * three["x"]
        d["b4"] = into * three["x"] + made - of(wt, four, five, "x") - of(we, four, three, "x")
        d["b5"] = of(wt, four, five, "x") - of(w5, five, air, "x")
        d["U1"] = of(w1, air, one, "h") - of(wc, one, two, "h")
        d["U2"] = of(wc, one, two, "h") + pc - of(w2, two, behind, "h")
        if halves:
            d["m6"] = w2 - w3
            d["b6"] = of(w2, two, late, "x") - of(w3, late, three, "x")
            d["U6"] = of(w2, two, late, "h") - of(w3, late, three, "h")
        d["U3"] = into3 + egr3 - into * three["h"]
        d["U4"] = exhaust_h - of(wt, four, five, "h") - of(we, four, three, "h") - q4
        d["U5"] = of(wt, four, five, "h") - pt - of(w5, five, air, "h")
        rotor, wall, control = mv["rotor"], mv["exhaust_wall"], mv["control"]
        d["turbo"] = ((pt - pc) / turbo - rotor["bearing_nms"] * turbo) / rotor["inertia_kgm2"]
        d["wall"] = (q4 - wall["ambient_wpk"] * (y["wall"] - T_AIR)) / wall["capacity_jpk"]
        d["vanes"] = (vanes - y["vanes"]) / control["vanes_lag_s"]
        d["egr"] = (egr_open - y["egr"]) / control["egr_lag_s"]
        d["meter"] = (w1 - y["meter"]) / control["meter_lag_s"]
        d["boost"] = growth
        if self.hold is not None:
            d["pedal"] = (self.hold - torque) / self.full(w)
            return list(d.values())
        slip = tanh(w - self.k * y["road"]) * self.clutch
        d["engine"] = (torque - slip) / self.file["inertia_kgm2"]
        d["tyre"] = (slip * self.k * self.eta - y["tyre"]) / 0.05
        d["road"] = (y["tyre"] - self.road(y["road"])) / self.m
        return list(d.values())

    def named(self, values):
        """States by name."""
        return dict(zip(NAMES if self.join is None else NAMES + SECOND_PIPE, values, strict=True))

    def tip_in(self, start, times, pedal_per_s):
        """One dict of states per time, from a state at time 0 with the pedal going down; LSODA at 1e-9."""
        self.hold, self.rate = None, pedal_per_s
        driven = solve_ivp(
            self.rates, (0, times[-1]), start, "LSODA", times, rtol=1e-9, atol=1e-10, max_step=0.02
        )
        assert driven.success
        return [self.named(state) for state in driven.y.T]

    def boost(self, y):
        """Pressure of the intake manifold in a state."""
        return gas(y["m3"], y["b3"], y["U3"], self.mv["volumes"]["intake_manifold_l"] / 1e3)["p"]

    def accel(self, y):
        """Acceleration in a state."""
        return (y["tyre"] - self.road(y["road"])) / self.m

"""Every plan of a small problem, by a battery step of its own in plain Python: no code of hevopt's is used.

Of the problem only what its user gave is read: curves, limits, table, start and end. Which controls the battery
can deliver is found by looking at many charges of the window.
"""

from math import inf, sqrt

# A power that is the voltage's peak up to rounding is at the peak.
_PEAK_ROUNDING = 1e-9
# What a plan may leave the window by, as a share of it, and the end charge too: simulate's own rule.
WINDOW_ROUNDING = 1e-9
_CHARGES = 200
# Between two charges looked at a limit can be missed by this share.
_BLUR = 1e-4


class Pack:
    """Curves of a battery as lists, and its step."""

    def __init__(self, battery):
        self.soc = [float(s) for s in battery.soc]
        self.volt = [float(u) for u in battery.open_circuit_v]
        self.out_ohm = [float(r) for r in battery.discharge_ohm]
        self.in_ohm = [float(r) for r in battery.charge_ohm]
        self.capacity = float(battery.capacity_as)
        self.efficiency = float(battery.coulombic_efficiency)
        self.stored = [0.0]
        for i in range(len(self.soc) - 1):
            mean = (self.volt[i] + self.volt[i + 1]) / 2
            self.stored.append(
                self.stored[-1] + self.capacity * mean * (self.soc[i + 1] - self.soc[i])
            )

    def between(self, curve, soc):
        """A curve at a state of charge, its end segments continued."""
        i = len(self.soc) - 2
        while i > 0 and soc < self.soc[i]:
            i -= 1
        share = (soc - self.soc[i]) / (self.soc[i + 1] - self.soc[i])
        return curve[i] + (curve[i + 1] - curve[i]) * share

    def energy(self, soc):
        """Stored energy at a state of charge: the area under the voltage."""
        i = len(self.soc) - 2
        while i > 0 and soc < self.soc[i]:
            i -= 1
        mean = (self.volt[i] + self.between(self.volt, soc)) / 2
        return self.stored[i] + self.capacity * mean * (soc - self.soc[i])

    def charge(self, energy):
        """State of charge at a stored energy: a rising parabola's root."""
        i = len(self.stored) - 2
        while i > 0 and energy < self.stored[i]:
            i -= 1
        area = (energy - self.stored[i]) / self.capacity
        rise = (self.volt[i + 1] - self.volt[i]) / (self.soc[i + 1] - self.soc[i])
        at = sqrt(max(self.volt[i] ** 2 + 2 * rise * area, 1e-12 * self.volt[i] ** 2))
        return self.soc[i] + 2 * area / (self.volt[i] + at)

    def current(self, power, soc):
        """Current of a terminal power at a state of charge; None where the voltage cannot deliver it."""
        volt = self.between(self.volt, soc)
        ohm = self.between(self.in_ohm if power < 0 else self.out_ohm, soc)
        inner = 1 - 4 * ohm * power / volt / volt
        if inner < -_PEAK_ROUNDING:
            return None
        return 2 * power / volt / (1 + sqrt(max(inner, 0.0)))

    def after(self, energy, power, step_s):
        """Stored energy after a step; None where the voltage cannot deliver the power."""
        soc = self.charge(energy)
        current = self.current(power, soc)
        if current is None:
            return None
        rate = self.between(self.volt, soc) * current
        return energy - step_s * (rate * self.efficiency if power < 0 else rate)


class Limits:
    """What a battery can deliver and take, found by a look at many charges of its window."""

    def __init__(self, battery):
        pack = Pack(battery)
        low, high = battery.soc_min, battery.soc_max
        charges = [low + (high - low) * n / _CHARGES for n in range(_CHARGES + 1)]
        charges += [s for s in pack.soc if low <= s <= high]
        self.volts = [pack.between(pack.volt, s) for s in charges]
        self.ohms = {
            True: [pack.between(pack.in_ohm, s) for s in charges],
            False: [pack.between(pack.out_ohm, s) for s in charges],
        }
        self.most_a = {True: battery.current_max_charge_a, False: battery.current_max_discharge_a}
        self.most_w = {True: battery.power_max_charge_w, False: battery.power_max_discharge_w}

    def deliverable(self, power):
        """Whether every charge of the window can deliver or take it; None where it is too close to tell."""
        ways = {self._every_charge(power * share) for share in (1 - _BLUR, 1 + _BLUR)}
        return ways.pop() if len(ways) == 1 else None

    def _every_charge(self, power):
        charging = power < 0
        if abs(power) > self.most_w[charging]:
            return False
        for volt, ohm in zip(self.volts, self.ohms[charging], strict=True):
            inner = 1 - 4 * ohm * power / volt / volt
            if inner < 0 or abs(2 * power / volt / (1 + sqrt(inner))) > self.most_a[charging]:
                return False
        return True


def _of(switching, k, before, mode):
    """What a switch counts at step k, of one matrix for all steps or one for each."""
    return switching[before, mode] if switching.ndim == 2 else switching[k, before, mode]


def every_plan(problem):
    """(cost, stored energy at the end, furthest outside the window) of every plan that simulate may accept.

    Switching takes its energy before the step. A plan that keeps inside is outside by less than 0.
    """
    table, pack = problem.table, Pack(problem.battery)
    low, high = pack.energy(problem.battery.soc_min), pack.energy(problem.battery.soc_max)
    slack = max(WINDOW_ROUNDING * (high - low), 4e-12 * high)
    plans = [(0.0, pack.energy(problem.soc_start), problem.start_mode, -inf)]
    for k in range(len(table.step_s)):
        step_s = float(table.step_s[k])
        controls = [
            (
                float(table.fuel_kg[k, c]) + problem.nox_weight * float(table.nox_kg[k, c]),
                float(table.battery_power_w[k, c]),
                int(table.mode[c]),
            )
            for c in range(table.reject.shape[1])
            if table.reject[k, c] == 0
        ]
        following = []
        for cost, energy, mode, out in plans:
            for own, power, to in controls:
                if not _of(table.switch_allowed, k, mode, to):
                    continue
                between = energy - float(_of(table.switch_energy_j, k, mode, to))
                if not low - slack <= between <= high + slack:
                    continue
                left = pack.after(between, power, step_s)
                if left is None or not low - slack <= left <= high + slack:
                    continue
                total = cost + own + float(_of(table.switch_fuel_kg, k, mode, to))
                ends = low - between, between - high, low - left, left - high
                following.append((total, left, to, max(out, *ends)))
        plans = following
    return [(cost, energy, out) for cost, energy, _, out in plans]

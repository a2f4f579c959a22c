"""A policy: the control of least fuel, where stored energy has a price that rises as the charge falls.

hevopt compare --cycle hwfet --architectures C2 --policy examples/policy.py:priced
"""

import numpy as np

from hevopt import policy


@policy
def priced(now):
    price_kgpj = 6e-8 * (1 + 10 * (now.soc_end_min - now.soc))
    cost_kg = now.fuel_kg + now.switch_fuel_kg + price_kgpj * now.drain_j
    return np.argmin(np.where(now.usable, cost_kg, np.inf))

"""A controller that learns by driving: the environment of hevopt.gym, a cost-to-go of four numbers, NumPy alone.

python examples/learnt.py

What is still to be burnt after a step is guessed from what is stored, from whether the engine turns and from what
the driver asks for. The four numbers of that guess are learnt from the returns of whole drives, by the cross-
entropy method (R. Y. Rubinstein, Methodology and Computing in Applied Probability 1, 1999): draw some, drive by
each, draw the next ones around the best. Afterwards it drives a cycle not seen before, beside dp and the bound.
"""

import numpy as np

from hevopt import build_problem, compare, load_architecture, load_cycle, policy
from hevopt.gym import HybridEnv

CAR, TAUGHT, DRIVEN = "C2", ("udds", "hwfet"), "nedc"
ROUNDS, DRAWN, BEST = 8, 10, 3
# Price of charge, in that of the first drive's certificate; by how much it rises as a window of charge is missing;
# grams that an engine saves by turning already, and by each 10 kW at the wheels.
GUESS, SPREAD = np.array([1.2, 2.0, 0.3, 0.3]), np.array([0.2, 2.0, 0.3, 0.3])


def decided(weights, price_kgpj):
    """The policy of some weights: the usable control of least cost in the step and after it."""
    price, rise, turning_g, turning_gp10kw = weights

    @policy
    def learnt(now):
        missing = (now.soc_end_min - now.soc) / (now.soc_max - now.soc_min)
        saved_g = turning_g + turning_gp10kw * max(now.wheel_power_w, 0.0) / 1e4
        cost_g = 1e3 * (now.fuel_kg + now.switch_fuel_kg) - saved_g * now.engine_on
        cost_g = cost_g + 1e3 * price_kgpj * (price + rise * missing) * now.drain_j
        return int(np.argmin(np.where(now.usable, cost_g, np.inf)))

    return learnt


def returns(env, choose, drives):
    """Sum of all rewards of some drives, in g."""
    total = 0.0
    for number in range(drives):
        env.reset(options={"problem": number})
        over = False
        while not over:
            _, reward, over, _, _ = env.step(choose(env.now))
            total += reward
    return total


def learn(env, drives, rounds=ROUNDS, drawn=DRAWN, seed=0, said=print):
    """The policy of the best weights that some drives of an environment teach."""
    rng = np.random.default_rng(seed)
    env.reset(options={"problem": 0})
    price_kgpj, mean, spread = env.end_price_kgpj, GUESS, SPREAD
    best, most = mean, -np.inf
    for number in range(rounds):
        weights = rng.normal(mean, spread, (drawn, len(mean)))
        weights[0] = mean
        found = [returns(env, decided(one, price_kgpj), drives) for one in weights]
        order = np.argsort(found)[::-1][:BEST]
        mean, spread = weights[order].mean(axis=0), weights[order].std(axis=0) + SPREAD / 50
        if found[order[0]] > most:
            best, most = weights[order[0]], found[order[0]]
        said(f"round {number + 1}: {-most:.1f} g in all drives, by {np.round(best, 2)}")
    return decided(best, price_kgpj)


def main():
    car = load_architecture(CAR)
    env = HybridEnv(*(build_problem(car, load_cycle(name)) for name in TAUGHT))
    learnt = learn(env, len(TAUGHT))
    found = compare(DRIVEN, CAR, {"learnt": learnt, "a_ecms": None, "ecms": None, "dp": None})
    for row in found.rows:
        print(
            f"{row.strategy:6} {row.fuel_corrected_l_per_100km:.4f} l/100 km at equal end charge, end SOC "
            f"{row.soc_end:.3f}, {row.gap_percent:.2f} % above the bound, {row.status}"
            f"{', causal' if row.strategy in found.causal else ''}"
        )


if __name__ == "__main__":
    main()

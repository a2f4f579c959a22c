"""The short cycle of sizings in tests, and how their files begin."""

CYCLE = "time_s,speed_kmh\n" + "".join(
    f"{s},{max(0, min(4 * s - 20, 50, 260 - 4 * s))}\n" for s in range(71)
)
HEAD = 'architecture = "C2"\ncycles = ["short.csv"]\n'

"""The waist: control table, battery, problem, plan, and the one judge that drives a plan."""

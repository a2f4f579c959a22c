"""No car of a box of sizes burns less than so much: a lower bound over continuous ranges."""

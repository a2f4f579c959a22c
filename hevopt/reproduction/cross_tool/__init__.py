"""The real cars in another tool, FASTSim: wheels step by step, its constants, where its fuel differs."""

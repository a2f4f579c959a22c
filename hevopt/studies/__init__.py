"""Cases, their rows, and the studies made of them: comparison, front, sensitivity."""

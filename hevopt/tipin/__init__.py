"""The study of turbo-lag: a car at constant speed, the pedal down; variations, and machines that fill the hole."""

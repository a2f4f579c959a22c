"""What a car is: components and their physics, as types; no file is read here."""

"""Cars as text: the models of their files, what each key means, and how a file becomes a car."""

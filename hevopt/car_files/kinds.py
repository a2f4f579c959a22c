"""The components that an architecture names, and the kind of file that each is."""

COMPONENTS = ("car", "engine", "source", "gearbox", "machine", "machine_2", "machine_3", "battery")
MACHINES = ("machine", "machine_2", "machine_3")


def kind_of(component: str) -> str:
    """The kind of file that a component is: every machine is one."""
    return "machine" if component in MACHINES else component

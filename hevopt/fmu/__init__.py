"""The driven car as a unit of FMI 2.0 for co-simulation with other tools; needs the extra `fmu`."""

from hevopt.errors import DataError

try:
    import pythonfmu  # noqa: F401
except ImportError:
    raise DataError(
        'an FMU needs PythonFMU, which is not installed; needed: pip install "hevopt[fmu]"'
    ) from None

from hevopt.fmu.export import export_fmu

__all__ = ["export_fmu"]

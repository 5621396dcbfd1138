"""Packages that only some commands need, each in an extra: `pip install lapwing[EXTRA]`."""

from importlib.util import find_spec

EXTRAS = {
    "control": "tune",
    "jinja2": "report",
    "matplotlib": "report",
    "plotly": "report",
    "pymavlink": "mavlink",
    "pyulog": "flights",
}  # extra by package


def missing(*packages: str) -> str:
    """Return the first of the packages that is not installed and the command that installs it; "" if there is none."""
    return next((_advice(package) for package in packages if find_spec(package) is None), "")


def require(*packages: str) -> None:
    """Raise ValueError if one of the packages is not installed."""
    if message := missing(*packages):
        raise ValueError(message)


def missing_in(error: ImportError) -> str:
    """Return the package that an import lacked and the command that installs it; "" if it is in no extra."""
    package = (error.name or "").partition(".")[0]
    return _advice(package) if package in EXTRAS and isinstance(error, ModuleNotFoundError) else ""


def _advice(package: str) -> str:
    return f"{package} is not installed; pip install lapwing[{EXTRAS[package]}]"

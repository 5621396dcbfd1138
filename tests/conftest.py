"""Order of the files, nightly tests, peak memory of the workers, and kernels without compilation.

Long files start first, so that no worker runs one alone at the end.
"""

import resource

import hypothesis
import pytest

from lapwing.kernels.compiler import decorators

SLOWEST = (  # minutes each
    "test_readme.py",
    "test_real_firmware.py",  # waits for the clock while others compile
    "test_rust_controller.py",
    "test_exact_arithmetic.py",
    "test_scenes.py",
    "test_propeller_failures.py",
    "test_faults.py",
    "test_library.py",
    "test_options.py",
    "test_compose.py",
)
_PEAK = "peak_memory_mb"
_peaks = pytest.StashKey[dict[str, float]]()

# Examples compile kernels, on a busy machine. Every run has the same examples.
hypothesis.settings.register_profile("lapwing", deadline=None, derandomize=True)
hypothesis.settings.load_profile("lapwing")


def pytest_configure(config: pytest.Config) -> None:
    """Prepare the peaks before any worker ends."""
    config.stash[_peaks] = {}


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Move the slowest files, in their order, then the other long tests, to the front; keep the order otherwise.

    Nightly tests are left out unless `-m` names them.
    """
    if "nightly" not in config.option.markexpr:
        left_out = [item for item in items if item.get_closest_marker("nightly")]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in left_out]
    ranks = {name: rank for rank, name in enumerate(SLOWEST)}
    items.sort(key=lambda item: (ranks.get(item.path.name, len(SLOWEST)), item.get_closest_marker("long") is None))


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Send the peak memory of a worker to the controlling process."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0  # in kB on Linux
    if hasattr(session.config, "workeroutput"):
        session.config.workeroutput[_PEAK] = peak
    elif not session.config.stash[_peaks]:
        session.config.stash[_peaks]["one process"] = peak


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node) -> None:
    """Store the peak memory of a worker; a crashed worker sent none."""
    if result := getattr(node, "workeroutput", {}).get(_PEAK):
        node.config.stash[_peaks][node.gateway.id] = result


def pytest_terminal_summary(terminalreporter) -> None:
    """Print the peak memory of each process."""
    peaks = terminalreporter.config.stash[_peaks]
    terminalreporter.write_line(f"peak memory: {', '.join(f'{k} {v:.0f} MB' for k, v in sorted(peaks.items()))}")


@pytest.fixture
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Run kernels that Python calls as Python functions, for tests that evaluate them too seldom to compile them.

    The results are bit-for-bit those of compiled kernels (`test_uncompiled_plant_equals_compiled_plant`). Random
    numbers, whose integers overflow, and the blocks of a flight stay compiled. Kernels that use vector registers, such
    as those of ground contact, have no form in Python.
    """
    dispatcher = decorators._Dispatcher
    compiled = dispatcher.__call__

    def call(self, *arguments, **named):
        if self.py_func.__module__.startswith(("lapwing.dynamics.noise", "lapwing.cosim.")):
            return compiled(self, *arguments, **named)
        return self.py_func(*arguments, **named)

    monkeypatch.setattr(dispatcher, "__call__", call, raising=False)
